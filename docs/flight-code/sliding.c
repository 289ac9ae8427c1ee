/* sliding.c: made by starhold 0.3.0; see sliding.h. Do not edit: change the scenario and export it again. */

#include "sliding.h"

#include <stdbool.h>

#if defined(__FAST_MATH__) || (defined(__FLT_EVAL_METHOD__) && __FLT_EVAL_METHOD__ != 0)
#error "this code needs IEEE arithmetic in doubles: no -ffast-math, no x87"
#endif
#if !defined(__GNUC__) || defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif

typedef sliding_quaternion_t quaternion_t;
typedef sliding_vector_t vector_t;

/* The surface gain, the switching gain and, to trade accuracy for less chatter, the thickness of a
   boundary layer. */
typedef struct {
    vector_t surface_gain; /* 1/s: K of the surface w + K q = 0, symmetric positive definite */
    vector_t switching_gain; /* N m: switching torque, above the disturbance */
    double boundary_layer; /* rad/s: boundary layer; 0 switches by sign */
} gains_t;

/* A rigid spacecraft. */
typedef struct {
    vector_t inertia; /* kg m^2: of a craft with wheels without their rotors' about their axes */
} craft_t;

/* The attitude of the target. */
typedef struct {
    quaternion_t attitude; /* unit quaternion, scalar first */
} inertial_params_t;

/* The numbers of a loop besides those of craft and law, an argument of kernels. */
typedef struct {
    double limit;
    inertial_params_t target;
} setup_t;

/* Constants of the flight code. */
typedef struct {
    gains_t gains;
    craft_t craft;
    setup_t setup;
} parameters_t;

/* Attitude q_BN (inertial to body), rate omega_BN_B (rad/s), position and velocity (inertial; m, m/s), and
   the torque of the actuators (body, N m), which has its own dynamics if the actuators lag. */
typedef struct {
    quaternion_t attitude;
    vector_t rate;
} state_t;

/* The target attitude q_RN (inertial to target axes), and the target's angular velocity (rad/s) and
   acceleration (rad/s2), both in target axes. */
typedef struct {
    quaternion_t attitude;
} goal_t;

/* The inputs of a measurement besides the state: the goal (None without a target), whether it never turns,
   the modelled external torque (N m, body), the effectors' momentum (N m s, body), the control period (s),
   the limit of the command, and all readings of the sensors, one attribute each. */
typedef struct {
    goal_t goal;
} scene_t;

/* Quantities that a law reads at a control instant; vectors are in body axes. */
typedef struct {
    quaternion_t attitude; /* rotation from the target axes to the body axes, scalar first */
    vector_t rate; /* rad/s: angular velocity relative to the target */
    vector_t body_rate; /* rad/s: absolute angular velocity */
    vector_t target_acceleration; /* rad/s^2: derivative of target_rate in the rotating body axes */
} measurement_t;

static const parameters_t parameters = {
    .gains = {
        .surface_gain = {0.08, 0.08, 0.08}, /* 1/s */
        .switching_gain = {0.005, 0.005, 0.005}, /* N m */
        .boundary_layer = 0.0, /* rad/s */
    },
    .craft = {
        .inertia = {2.0, 3.0, 4.0}, /* kg m^2 */
    },
    .setup = {
        .limit = 0.01,
        .target = {
            .attitude = {1.0, 0.0, 0.0, 0.0},
        },
    },
};


/* -------------------------------- parts.targets.inertial -------------------------------- */

/* Return the attitude, at rest. */
static goal_t inertial_goal(const inertial_params_t *params)
{
    return (goal_t){.attitude = params->attitude};
}

/* ---------------------------------- algebra.quaternion ---------------------------------- */

/* Return (q1, q2, q3). */
static vector_t vector_part(quaternion_t q)
{
    return (vector_t){q.q1, q.q2, q.q3};
}

/* ------------------------------------ algebra.vector ------------------------------------ */

/* Return the vector product. */
static vector_t cross(vector_t a, vector_t b)
{
    return (vector_t){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/* Return c a. */
static vector_t scale(double c, vector_t a)
{
    return (vector_t){c * a.x, c * a.y, c * a.z};
}

/* Return a + b. */
static vector_t add(vector_t a, vector_t b)
{
    return (vector_t){a.x + b.x, a.y + b.y, a.z + b.z};
}

/* Return a x (m a) for a symmetric m: the gyroscopic torque is gyroscopic_torque(J, w). */
static vector_t gyroscopic_torque(vector_t m, vector_t a)
{
    return (vector_t){(m.z - m.y) * (a.y * a.z), (m.x - m.z) * (a.z * a.x), (m.y - m.x) * (a.x * a.y)};
}

/* ---------------------------------- algebra.quaternion ---------------------------------- */

/* Return the inverse rotation. */
static quaternion_t conjugate(quaternion_t q)
{
    return (quaternion_t){q.q0, -q.q1, -q.q2, -q.q3};
}

/* Return the Hamilton product a b: first the rotation a, then the rotation b about the axes already
   rotated. */
static quaternion_t multiply(quaternion_t a, quaternion_t b)
{
    return (quaternion_t){a.q0 * b.q0 - a.q1 * b.q1 - a.q2 * b.q2 - a.q3 * b.q3,
        a.q0 * b.q1 + a.q1 * b.q0 + a.q2 * b.q3 - a.q3 * b.q2,
        a.q0 * b.q2 + a.q2 * b.q0 + a.q3 * b.q1 - a.q1 * b.q3,
        a.q0 * b.q3 + a.q3 * b.q0 + a.q1 * b.q2 - a.q2 * b.q1};
}

/* Return the rotation from the target axes to the body axes, target* q; the identity when the attitudes
   agree. */
static quaternion_t relative(quaternion_t target, quaternion_t q)
{
    return multiply(conjugate(target), q);
}

/* ------------------------------- parts.bodies.rigid_body -------------------------------- */

/* Return the law's measurement of a state from sensors or estimators. */
static measurement_t observe(const state_t *state, const scene_t *scene)
{
    const quaternion_t error = relative(scene->goal.attitude, state->attitude);
    return (measurement_t){.attitude = error, .rate = state->rate, .body_rate = state->rate,
        .target_acceleration = {0.0, 0.0, 0.0}};
}

/* ------------------------------------ algebra.vector ------------------------------------ */

/* Return the product component by component. */
static vector_t times(vector_t a, vector_t b)
{
    return (vector_t){a.x * b.x, a.y * b.y, a.z * b.z};
}

/* Return the matrix-vector product; a vector in place of the matrix stands for a diagonal one. */
static vector_t apply(vector_t m, vector_t a)
{
    return times(m, a);
}

/* ------------------------------------- laws.sliding ------------------------------------- */

/* Return s = w + K q (rad/s). */
static vector_t surface(const measurement_t *measurement, const gains_t *gains)
{
    return add(measurement->rate, apply(gains->surface_gain, vector_part(measurement->attitude)));
}

/* ------------------------------------ algebra.scalar ------------------------------------ */

/* Return the larger. */
static double maximum(double a, double b)
{
    return b < a ? a : b;
}

/* Keep x within [-limit, limit]; a NaN passes through. */
static double clip(double x, double limit)
{
    return limit < x ? limit : x < -limit ? -limit : x;
}

/* Return -1, 0 or +1; a NaN passes through. */
static double sign(double x)
{
    return x < 0.0 ? -1.0 : 0.0 < x ? 1.0 : x;
}

/* ------------------------------------- laws.sliding ------------------------------------- */

/* Return sign(s), or s/layer within the layer. */
static double switch_of(double s, double layer)
{
    const bool inside = 0.0 < layer;
    return inside ? clip(s / maximum(layer, 1e-300), 1.0) : sign(s);
}

/* ------------------------------------ algebra.vector ------------------------------------ */

/* Return a - b. */
static vector_t subtract(vector_t a, vector_t b)
{
    return (vector_t){a.x - b.x, a.y - b.y, a.z - b.z};
}

/* ------------------------------------- laws.sliding ------------------------------------- */

/* Return the torque (N m) that keeps s = w + K q constant without external torque. */
static vector_t equivalent_torque(const measurement_t *measurement, vector_t surface_gain,
    const craft_t *craft)
{
    const vector_t q = vector_part(measurement->attitude);
    const vector_t q_rate = scale(0.5, add(scale(measurement->attitude.q0, measurement->rate),
        cross(q, measurement->rate)));
    const vector_t wanted = subtract(measurement->target_acceleration, apply(surface_gain, q_rate));
    return add(gyroscopic_torque(craft->inertia, measurement->body_rate), apply(craft->inertia, wanted));
}

/* Return the control torque (N m, body). */
static vector_t sliding_torque(const measurement_t *measurement, const gains_t *gains, const craft_t *craft)
{
    const vector_t s = surface(measurement, gains);
    const vector_t equivalent = equivalent_torque(measurement, gains->surface_gain, craft);
    const vector_t switching = {switch_of(s.x, gains->boundary_layer), switch_of(s.y, gains->boundary_layer),
        switch_of(s.z, gains->boundary_layer)};
    return subtract(equivalent, times(gains->switching_gain, switching));
}

/* ------------------------------------ algebra.vector ------------------------------------ */

/* Keep each component within [-limit, limit]. */
static vector_t clip_axes(vector_t a, double limit)
{
    return (vector_t){clip(a.x, limit), clip(a.y, limit), clip(a.z, limit)};
}

/* -------------------------------- parts.actuators.limits -------------------------------- */

/* Saturate each component at +-limit, as wheels or thruster pairs along the axes do. */
static vector_t limit_axis(vector_t command, double limit)
{
    return clip_axes(command, limit);
}

/* -------------------------------------- interface --------------------------------------- */

void sliding_init(sliding_state_t *state)
{
    state->unused = 0.0;
}

void sliding_step(sliding_state_t *state, const sliding_input_t *input, sliding_command_t *command)
{
    (void)state;
    const state_t known = {.attitude = input->attitude, .rate = input->rate};
    const scene_t scene = {.goal = inertial_goal(&parameters.setup.target)};
    const measurement_t measurement = observe(&known, &scene);
    const vector_t wanted = limit_axis(sliding_torque(&measurement, &parameters.gains, &parameters.craft),
        parameters.setup.limit);
    command->torque = wanted;
}
