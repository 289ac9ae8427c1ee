/* lqr: Closed-form LQR

   u = -K_rate w - K_attitude q (+ w x Jw), optimal for the linearised motion; gains from formulas by
   `form`

   Made by starhold 0.3.0 from the scenario three-laws, law lqr.
   Source: published study of inertial stabilisation by closed-form linear-quadratic laws
   Assumes: rigid body; inertia known; no external torque; torque not limited; K_attitude^-1 J > 0,
   K_attitude^-1 K_rate > 0; w.K_attitude^-1(w x Jw) = 0 for all w, or the gyroscopic torque cancelled.

   Command limit: 0.01 N m on each axis. Quaternion sign: as published.

   A step does at most 82 additions, multiplications, divisions and roots, and 6 comparisons.
   Bits are those of the simulation where doubles are IEEE and nothing is contracted or reassociated:
   compile with -std=c99 -ffp-contract=off, never with -ffast-math.

   Program of the law: sha256 851ab1c92f50234498ca20e7141e8ad0edc5898615f514d663a47b1df0e15661

   Certificate: certificate.json, sha256 f1625c8eb7458494ff65d2a6337fd7600b30134f589fd2f7eac33467bf78e5e1:
   proved
   Claims:
     proved: converges: with unlimited torque, from every attitude and rate the body comes to rest on
     target, almost always at q0 = 1; it may turn the long way to get there (unwinding)
     proved: within the torque limit: from the level set of V that holds rest at up to 16.55° and, on
     target, 1.169°/s about any axis, the torque never exceeds 0.01 N m on every axis
     proved: uncertain inertia: with unlimited torque, from every attitude and rate it converges with every
     entry of the inertia off by up to 100 % of sqrt(J_ii J_jj)
     proved: torque held between samples: the linear loop is stable with the torque held for 0.1 s and for
     every period up to 19.99 s
     proved: pointing as it flies: within 0.02184° of the target after 705.4 s at all times, from rest at
     up to 25°, torque held for 0.1 s, with torques from outside of up to 3.486e-06 N m
   These claims assume: rigid body; exact measurement and ideal actuators; inertia exactly as given; no
   torque from outside; torque applied continuously; torque not limited; inertia within the tolerance;
   linear motion near rest on a target at rest; torques from outside and errors of the command are no
   larger than told; the torque is what the law asks for at the last sample, and the error.
   Check it independently: starhold check certificate.json */

#ifndef LQR_H
#define LQR_H

#ifdef __cplusplus
extern "C" {
#endif

/* s: the step is to be called once in each such period. */
#define LQR_PERIOD (0.1)

/* Scalar part first, Hamilton product. */
typedef struct {
    double q0, q1, q2, q3;
} lqr_quaternion_t;

/* Components along the axes. */
typedef struct {
    double x, y, z;
} lqr_vector_t;

typedef struct {
    lqr_quaternion_t attitude; /* inertial to body, unit quaternion, scalar first */
    lqr_vector_t rate; /* rad/s: angular velocity, body axes */
} lqr_input_t;

typedef struct {
    lqr_vector_t torque; /* N m: torque commanded, within the limits, body axes */
} lqr_command_t;

/* The law has no memory. C has no empty structs. */
typedef struct {
    double unused;
} lqr_state_t;

/* Sets the state to that of the scenario's start. */
void lqr_init(lqr_state_t *state);

/* One control step: u = -K_rate w - K_attitude q (+ w x Jw), optimal for the linearised motion; gains from
   formulas by `form`. Takes what was measured at this instant, gives what to command until the next, and
   changes the state. It calls nothing but sqrt and keeps nothing outside the state. It does not check what
   it is given: a NaN that the law uses comes out as one. */
void lqr_step(lqr_state_t *state, const lqr_input_t *input, lqr_command_t *command);

#ifdef __cplusplus
}
#endif

#endif /* LQR_H */
