/* mpc: Predictive

   minimises the sum of x'Qx + u'Ru over a horizon of the motion linearised at each step, within the torque
   limit

   Made by starhold 0.3.0 from the scenario three-laws, law mpc.
   Source: published comparison of Lyapunov, sliding-mode and predictive attitude control
   Assumes: rigid body; inertia known; no external torque but the gravity gradient; small attitude error,
   or a horizon short compared with the slew.

   Command limit: 0.01 N m on each axis. Quaternion sign: as published.
   Fixed in this code: horizon = 10, terminal = riccati, limit = axis, budget = 50.

   A step does at most 48809922 additions, multiplications, divisions and roots, and 1345182 comparisons.
   Bits are those of the simulation where doubles are IEEE and nothing is contracted or reassociated:
   compile with -std=c99 -ffp-contract=off, never with -ffast-math.


   Certificate: certificate.json, sha256 e706f2323a3ead15fa68c8576674d2f343ccdd7bbaa06e46c642cf89c5098fbb:
   proved
   Claims:
     proved: pointing as it flies: within 0.007201° of the target after 487.1 s at all times, from rest at
     up to 12°, torque held for 0.1 s, with torques from outside of up to 3.486e-06 N m and a plan within
     7.117e-05 N m of a polynomial
   These claims assume: rigid body; inertia exactly as given; torques from outside and errors of the
   command are no larger than told; the torque is what the law asks for at the last sample, and the error;
   torque of a plan as stated, of nearly the least cost.
   Check it independently: starhold check certificate.json */

#ifndef MPC_H
#define MPC_H

#ifdef __cplusplus
extern "C" {
#endif

/* s: the step is to be called once in each such period. */
#define MPC_PERIOD (0.1)

/* Scalar part first, Hamilton product. */
typedef struct {
    double q0, q1, q2, q3;
} mpc_quaternion_t;

/* Components along the axes. */
typedef struct {
    double x, y, z;
} mpc_vector_t;

typedef struct {
    mpc_quaternion_t attitude; /* inertial to body, unit quaternion, scalar first */
    mpc_vector_t rate; /* rad/s: angular velocity, body axes */
    mpc_vector_t position; /* m: from the centre of attraction, inertial axes */
} mpc_input_t;

typedef struct {
    mpc_vector_t torque; /* N m: torque commanded, within the limits, body axes */
} mpc_command_t;

/* The memory from step to step: set it by the function below, and do not change it. */
typedef struct {
    double numbers[697];
} mpc_state_t;

/* Sets the state to that of the scenario's start. */
void mpc_init(mpc_state_t *state);

/* One control step: minimises the sum of x'Qx + u'Ru over a horizon of the motion linearised at each step,
   within the torque limit. Takes what was measured at this instant, gives what to command until the next,
   and changes the state. It calls nothing but sqrt and keeps nothing outside the state. It does not check
   what it is given: a NaN that the law uses comes out as one. */
void mpc_step(mpc_state_t *state, const mpc_input_t *input, mpc_command_t *command);

#ifdef __cplusplus
}
#endif

#endif /* MPC_H */
