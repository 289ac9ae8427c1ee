/* sliding: Sliding mode

   reaches the surface w + K q = 0 against any torque below `switching_gain`, then slides to the target

   Made by starhold 0.3.0 from the scenario three-laws, law sliding.
   Source: Smooth sliding-mode control for spacecraft attitude tracking maneuvers (1995)
   Source: published comparison of Lyapunov, sliding-mode and predictive attitude control, eq. (18)
   Assumes: rigid body; inertia known; |M_ext| < switching_gain on every axis; torque not limited; q0 > 0
   on the surface.

   Command limit: 0.01 N m on each axis. Quaternion sign: as published.

   A step does at most 82 additions, multiplications, divisions and roots, and 24 comparisons.
   Bits are those of the simulation where doubles are IEEE and nothing is contracted or reassociated:
   compile with -std=c99 -ffp-contract=off, never with -ffast-math.

   Program of the law: sha256 d376113421b72aa7157bcc6305eb095cd9517e199b91f6fd8db1158f23a2d30a
   ****************************************************************************************************
   WARNING  NOT DECIDED: torque held between samples: the linear loop is stable with the torque held for
   0.1 s.
   ****************************************************************************************************

   Certificate: certificate.json, sha256 c5201cb99a17d5abaee79376438c83ae314e426f7d4d9dd03ea1ff68632cd09c:
   undecided
   Claims:
     proved: reaches its surface: with unlimited torque, from every attitude and rate the motion reaches
     the surface against any torque from outside of up to 3.486e-06 N m on an axis and slides to rest on
     target
     undecided: torque held between samples: the linear loop is stable with the torque held for 0.1 s
   These claims assume: rigid body; exact measurement and ideal actuators; inertia exactly as given; torque
   from outside bounded on each axis; torque applied continuously; torque not limited; linear motion near
   rest on a target at rest; no torque from outside.
   Check it independently: starhold check certificate.json */

#ifndef SLIDING_H
#define SLIDING_H

#ifdef __cplusplus
extern "C" {
#endif

/* s: the step is to be called once in each such period. */
#define SLIDING_PERIOD (0.1)

/* Scalar part first, Hamilton product. */
typedef struct {
    double q0, q1, q2, q3;
} sliding_quaternion_t;

/* Components along the axes. */
typedef struct {
    double x, y, z;
} sliding_vector_t;

typedef struct {
    sliding_quaternion_t attitude; /* inertial to body, unit quaternion, scalar first */
    sliding_vector_t rate; /* rad/s: angular velocity, body axes */
} sliding_input_t;

typedef struct {
    sliding_vector_t torque; /* N m: torque commanded, within the limits, body axes */
} sliding_command_t;

/* The law has no memory. C has no empty structs. */
typedef struct {
    double unused;
} sliding_state_t;

/* Sets the state to that of the scenario's start. */
void sliding_init(sliding_state_t *state);

/* One control step: reaches the surface w + K q = 0 against any torque below `switching_gain`, then slides
   to the target. Takes what was measured at this instant, gives what to command until the next, and
   changes the state. It calls nothing but sqrt and keeps nothing outside the state. It does not check what
   it is given: a NaN that the law uses comes out as one. */
void sliding_step(sliding_state_t *state, const sliding_input_t *input, sliding_command_t *command);

#ifdef __cplusplus
}
#endif

#endif /* SLIDING_H */
