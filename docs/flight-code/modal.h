/* modal: Modal

   u = -M - K x, x = (q0 - 1, q, w): K gives the linear motion around x the spectra phi_0, phi_1 and b |w|2

   Made by starhold 0.3.0 from the scenario landing, law fit.
   Source: published work on modal control of a spacecraft's angular motion on quaternions, by multi-level
   decomposition
   Assumes: rigid body; inertia known; external torque known; torque not limited.

   Command limit: none. Quaternion sign: as published.

   A step does at most 310 additions, multiplications, divisions and roots, and 0 comparisons.
   Bits are those of the simulation where doubles are IEEE and nothing is contracted or reassociated:
   compile with -std=c99 -ffp-contract=off, never with -ffast-math.

   Program of the law: sha256 99130acbe6b13c7bcd3c5cbc219c37d087ae6db2517dfd9e6fe729d84998d648

   Certificate: certificate.json, sha256 000a841c3ab114d6915216ccfb54b82df66bbedf70b212b2b6c3aeaad91042e7:
   proved
   Claims:
     proved: region of attraction: from the level set of V that holds rest at every attitude by the shorter
     rotation, and by the longer one up to 288.2° of 360° and, on target, 109.5°/s about any axis, the body
     comes to rest on target without leaving the set
     proved: torque held between samples: the linear loop is stable with the torque held for 0.005 s and
     for every period up to 2.334 s
   These claims assume: rigid body; exact measurement and ideal actuators; inertia exactly as given; no
   torque from outside; torque applied continuously; torque not limited; linear motion near rest on a
   target at rest.
   Check it independently: starhold check certificate.json */

#ifndef MODAL_H
#define MODAL_H

#ifdef __cplusplus
extern "C" {
#endif

/* s: the step is to be called once in each such period. */
#define MODAL_PERIOD (0.005)

/* Scalar part first, Hamilton product. */
typedef struct {
    double q0, q1, q2, q3;
} modal_quaternion_t;

/* Components along the axes. */
typedef struct {
    double x, y, z;
} modal_vector_t;

typedef struct {
    modal_quaternion_t attitude; /* inertial to body, unit quaternion, scalar first */
    modal_vector_t rate; /* rad/s: angular velocity, body axes */
} modal_input_t;

typedef struct {
    modal_vector_t torque; /* N m: torque commanded, within the limits, body axes */
} modal_command_t;

/* The law has no memory. C has no empty structs. */
typedef struct {
    double unused;
} modal_state_t;

/* Sets the state to that of the scenario's start. */
void modal_init(modal_state_t *state);

/* One control step: u = -M - K x, x = (q0 - 1, q, w): K gives the linear motion around x the spectra
   phi_0, phi_1 and b |w|2. Takes what was measured at this instant, gives what to command until the next,
   and changes the state. It calls nothing but sqrt and keeps nothing outside the state. It does not check
   what it is given: a NaN that the law uses comes out as one. */
void modal_step(modal_state_t *state, const modal_input_t *input, modal_command_t *command);

#ifdef __cplusplus
}
#endif

#endif /* MODAL_H */
