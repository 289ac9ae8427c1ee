/* lyapunov: Lyapunov

   u = -k_rate w - k_attitude q + w x Jw - M_ext: V is non-increasing whatever the modelled torque

   Made by starhold 0.3.0 from the scenario three-laws, law lyapunov.
   Source: published comparison of Lyapunov, sliding-mode and predictive attitude control, eq. (9)
   Assumes: rigid body; inertia known; external torque known; torque not limited.

   Command limit: 0.01 N m on each axis. Quaternion sign: as published.

   A step does at most 111 additions, multiplications, divisions and roots, and 6 comparisons.
   Bits are those of the simulation where doubles are IEEE and nothing is contracted or reassociated:
   compile with -std=c99 -ffp-contract=off, never with -ffast-math.

   Program of the law: sha256 d5137098524b4413b6d496ad62634b43647fe728da0c5962b960f411facfefe2

   Certificate: certificate.json, sha256 46eecfae39e337dfdcfc69aa8eb63e8be37f880f76889047d9ef82f5f4ee5ec1:
   proved
   Claims:
     proved: converges: with unlimited torque, from every attitude and rate the body comes to rest on
     target, almost always at q0 = 1; it may turn the long way to get there (unwinding)
     proved: within the torque limit: from the level set of V that holds rest at up to 97.3° and, on
     target, 3.166°/s about any axis, the torque never exceeds 0.01 N m on every axis
     proved: uncertain inertia: with unlimited torque, from every attitude and rate it converges whatever
     the inertia of the body really is
     proved: torque held between samples: the linear loop is stable with the torque held for 0.1 s and for
     every period up to 39.99 s
     proved: pointing as it flies: within 0.0002434° of the target after 4234 s at all times, from up to
     52° at up to 3.085°/s, torque held for 0.1 s, with torques from outside of up to 9e-09 N m beside
     those that the law is told
   These claims assume: rigid body; exact measurement and ideal actuators; inertia exactly as given; no
   torque from outside but what the law cancels; torque applied continuously; torque not limited; torque
   from outside bounded on each axis; no torque from outside; linear motion near rest on a target at rest;
   torques from outside and errors of the command are no larger than told; the torque is what the law asks
   for at the last sample, and the error; external torque known as at the measured attitude, its rate
   bounded.
   Check it independently: starhold check certificate.json */

#ifndef LYAPUNOV_H
#define LYAPUNOV_H

#ifdef __cplusplus
extern "C" {
#endif

/* s: the step is to be called once in each such period. */
#define LYAPUNOV_PERIOD (0.1)

/* Scalar part first, Hamilton product. */
typedef struct {
    double q0, q1, q2, q3;
} lyapunov_quaternion_t;

/* Components along the axes. */
typedef struct {
    double x, y, z;
} lyapunov_vector_t;

typedef struct {
    lyapunov_quaternion_t attitude; /* inertial to body, unit quaternion, scalar first */
    lyapunov_vector_t rate; /* rad/s: angular velocity, body axes */
    lyapunov_vector_t position; /* m: from the centre of attraction, inertial axes */
} lyapunov_input_t;

typedef struct {
    lyapunov_vector_t torque; /* N m: torque commanded, within the limits, body axes */
} lyapunov_command_t;

/* The law has no memory. C has no empty structs. */
typedef struct {
    double unused;
} lyapunov_state_t;

/* Sets the state to that of the scenario's start. */
void lyapunov_init(lyapunov_state_t *state);

/* One control step: u = -k_rate w - k_attitude q + w x Jw - M_ext: V is non-increasing whatever the
   modelled torque. Takes what was measured at this instant, gives what to command until the next, and
   changes the state. It calls nothing but sqrt and keeps nothing outside the state. It does not check what
   it is given: a NaN that the law uses comes out as one. */
void lyapunov_step(lyapunov_state_t *state, const lyapunov_input_t *input, lyapunov_command_t *command);

#ifdef __cplusplus
}
#endif

#endif /* LYAPUNOV_H */
