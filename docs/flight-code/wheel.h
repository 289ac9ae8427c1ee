/* wheel: Reaction-wheel law

   u = -k_rate w - S + w_abs x (J w_abs + H) + J w_target' - M_ext, S = 4 k q0 q from direction cosines

   Made by starhold 0.3.0 from the scenario wheels-orbital, law wheel.
   Source: published study of reaction-wheel attitude control with a given degree of stability
   Assumes: rigid body; inertia and wheel momentum known; external torque known; torque not limited.

   Command limit: none. Quaternion sign: as published.

   A step does at most 326 additions, multiplications, divisions and roots, and 4 comparisons.
   Bits are those of the simulation where doubles are IEEE and nothing is contracted or reassociated:
   compile with -std=c99 -ffp-contract=off, never with -ffast-math.

   Program of the law: sha256 4f874e55fa16eec8b64cc78923eef683c9775f1cdd52baf71d83b3a67f9942c4

   Certificate: certificate.json, sha256 dd90c534c812689ed3150081c50f094542efcd88966cc66acbd4872744d14335:
   proved
   Claims:
     proved: converges: with wheels that have neither limits nor friction, from every attitude and rate the
     body comes to rest on target, almost always: it could also rest at half turns, which are unstable
     proved: within the wheels' limits: from the level set of V that holds rest at up to 30.16° and, on
     target, 1.603°/s about any axis, while the total momentum is at most 0.02945 N m s, no motor gives
     more than 0.02 N m and no wheel stores more than 0.396 N m s
     proved: uncertain inertia: with wheels that have neither limits nor friction, from every attitude and
     rate it converges whatever the inertia of the body really is
     proved: torque held between samples: the linear loop is stable with the torque held for 0.1 s and for
     every period up to 13.62 s
     proved: pointing as it flies: within 0.0001379° of the target after 1633 s at all times, from up to
     45° at up to 0.2449°/s, torque held for 0.1 s, with torques from outside of up to 4.628e-08 N m beside
     those that the law is told and a total momentum of up to 0.02945 N m s
   These claims assume: rigid body; exact measurement and ideal actuators; inertia exactly as given; no
   torque from outside but what the law cancels; torque applied continuously; neither torque nor wheels
   limited, wheels without friction; wheels without friction; torque from outside bounded on each axis;
   target's motion at most as stated; total momentum at most as stated; no torque from outside; target at
   rest; no stored momentum; linear motion near rest on a target at rest; torques from outside and errors
   of the command are no larger than told; the torque is what the law asks for at the last sample, and the
   error; external torque known as at the measured attitude, its rate bounded.
   Check it independently: starhold check certificate.json */

#ifndef WHEEL_H
#define WHEEL_H

#ifdef __cplusplus
extern "C" {
#endif

/* s: the step is to be called once in each such period. */
#define WHEEL_PERIOD (0.1)

/* Scalar part first, Hamilton product. */
typedef struct {
    double q0, q1, q2, q3;
} wheel_quaternion_t;

/* Components along the axes. */
typedef struct {
    double x, y, z;
} wheel_vector_t;

typedef struct {
    double e[4];
} wheel_doubles4_t;

/* The absolute momentum of each rotor about its axis (N m s), and the angles (turns) of unbalanced rotors. */
typedef struct {
    wheel_doubles4_t momentum;
} wheel_wheels_state_t;

typedef struct {
    wheel_quaternion_t attitude; /* inertial to body, unit quaternion, scalar first */
    wheel_vector_t rate; /* rad/s: angular velocity, body axes */
    wheel_vector_t position; /* m: from the centre of attraction, inertial axes */
    wheel_vector_t velocity; /* m/s: inertial axes */
    wheel_wheels_state_t wheels; /* as their tachometers measure */
} wheel_input_t;

typedef struct {
    wheel_vector_t torque; /* N m: torque commanded, within the limits, body axes */
} wheel_command_t;

/* The memory from step to step: set it by the function below, and do not change it. */
typedef struct {
    wheel_quaternion_t followed;
} wheel_state_t;

/* Sets the state to that of the scenario's start. */
void wheel_init(wheel_state_t *state);

/* One control step: u = -k_rate w - S + w_abs x (J w_abs + H) + J w_target' - M_ext, S = 4 k q0 q from
   direction cosines. Takes what was measured at this instant, gives what to command until the next, and
   changes the state. It calls nothing but sqrt and keeps nothing outside the state. It does not check what
   it is given: a NaN that the law uses comes out as one. */
void wheel_step(wheel_state_t *state, const wheel_input_t *input, wheel_command_t *command);

#ifdef __cplusplus
}
#endif

#endif /* WHEEL_H */
