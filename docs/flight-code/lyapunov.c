/* lyapunov.c: made by starhold 0.3.0; see lyapunov.h. Do not edit: change the scenario and export it
   again. */

#include "lyapunov.h"

#include <math.h>

#if defined(__FAST_MATH__) || (defined(__FLT_EVAL_METHOD__) && __FLT_EVAL_METHOD__ != 0)
#error "this code needs IEEE arithmetic in doubles: no -ffast-math, no x87"
#endif
#if !defined(__GNUC__) || defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif

typedef lyapunov_quaternion_t quaternion_t;
typedef lyapunov_vector_t vector_t;

/* The gains are damping and stiffness. */
typedef struct {
    double k_rate; /* N m s: damping */
    double k_attitude; /* N m: stiffness against the quaternion's vector part */
} gains_t;

/* A rigid spacecraft. */
typedef struct {
    vector_t inertia; /* kg m^2: of a craft with wheels without their rotors' about their axes */
    double gravity; /* m^3/s^2: gravitational parameter of the body that it orbits */
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
    vector_t position;
} state_t;

/* The target attitude q_RN (inertial to target axes), and the target's angular velocity (rad/s) and
   acceleration (rad/s2), both in target axes. */
typedef struct {
    quaternion_t attitude;
} goal_t;

/* What attraction gives. */
typedef struct {
    double scalar;
    double inverse_square;
} attraction_result_t;

/* The inputs of a measurement besides the state: the goal (None without a target), whether it never turns,
   the modelled external torque (N m, body), the effectors' momentum (N m s, body), the control period (s),
   the limit of the command, and all readings of the sensors, one attribute each. */
typedef struct {
    goal_t goal;
    vector_t torque;
} scene_t;

/* Quantities that a law reads at a control instant; vectors are in body axes. */
typedef struct {
    quaternion_t attitude; /* rotation from the target axes to the body axes, scalar first */
    vector_t rate; /* rad/s: angular velocity relative to the target */
    vector_t body_rate; /* rad/s: absolute angular velocity */
    vector_t target_acceleration; /* rad/s^2: derivative of target_rate in the rotating body axes */
    vector_t external_torque; /* N m: modelled torque from outside at this attitude */
} measurement_t;

static const parameters_t parameters = {
    .gains = {
        .k_rate = 0.09, /* N m s */
        .k_attitude = 0.009, /* N m */
    },
    .craft = {
        .inertia = {2.0, 3.0, 4.0}, /* kg m^2 */
        .gravity = 398600000000000.0, /* m^3/s^2 */
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

/* ------------------------------------ algebra.vector ------------------------------------ */

/* Return the scalar product. */
static double dot(vector_t a, vector_t b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

/* ----------------------------- parts.environments.two_body ------------------------------ */

/* Return mu/r^3 and 1/r^2, with one division. */
static attraction_result_t attraction(vector_t position, const craft_t *craft)
{
    const double inverse_square = 1.0 / dot(position, position);
    return (attraction_result_t){.scalar = craft->gravity * inverse_square * sqrt(inverse_square),
        .inverse_square = inverse_square};
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

/* ---------------------------------- algebra.quaternion ---------------------------------- */

/* Return body components of a vector given in reference axes, R = q* r q. */
static vector_t to_body(quaternion_t q, vector_t r)
{
    const vector_t v = vector_part(q);
    const vector_t t = scale(2.0, cross(r, v));
    return add(add(r, scale(q.q0, t)), cross(t, v));
}

/* ------------------------------------- parts.craft -------------------------------------- */

/* Return the inertia of the whole craft, on which gravity acts (kg m2). */
static vector_t total_inertia(const craft_t *craft)
{
    return craft->inertia;
}

/* ------------------------------------ algebra.vector ------------------------------------ */

/* Return a x (m a) for a symmetric m: the gyroscopic torque is gyroscopic_torque(J, w). */
static vector_t gyroscopic_torque(vector_t m, vector_t a)
{
    return (vector_t){(m.z - m.y) * (a.y * a.z), (m.x - m.z) * (a.z * a.x), (m.y - m.x) * (a.x * a.y)};
}

/* ------------------------- parts.environments.gravity_gradient -------------------------- */

/* Return the gravity-gradient torque (N m) for the position in body axes (m) and strength 3 mu/r^5 (1/(m2
   s2)). */
static vector_t gravity_gradient(vector_t position, double strength, const craft_t *craft)
{
    return scale(strength, gyroscopic_torque(total_inertia(craft), position));
}

/* Return the torque on the body (N m, body axes). */
static vector_t gravity_gradient_torque(const state_t *state, const craft_t *craft)
{
    const attraction_result_t attraction_result = attraction(state->position, craft);
    return gravity_gradient(to_body(state->attitude, state->position), 3.0 * attraction_result.scalar *
        attraction_result.inverse_square, craft);
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
        .target_acceleration = {0.0, 0.0, 0.0}, .external_torque = scene->torque};
}

/* ------------------------------------ algebra.vector ------------------------------------ */

/* Return a - b. */
static vector_t subtract(vector_t a, vector_t b)
{
    return (vector_t){a.x - b.x, a.y - b.y, a.z - b.z};
}

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

/* ------------------------------------ laws.lyapunov ------------------------------------- */

/* Return the control torque (N m, body). */
static vector_t lyapunov_torque(const measurement_t *measurement, const gains_t *gains, const craft_t *craft)
{
    const vector_t feedback = add(scale(-gains->k_rate, measurement->rate),
        scale(-gains->k_attitude, vector_part(measurement->attitude)));
    const vector_t gyroscopic = gyroscopic_torque(craft->inertia, measurement->body_rate);
    const vector_t model = add(subtract(gyroscopic, measurement->external_torque),
        apply(craft->inertia, measurement->target_acceleration));
    return add(feedback, model);
}

/* ------------------------------------ algebra.scalar ------------------------------------ */

/* Keep x within [-limit, limit]; a NaN passes through. */
static double clip(double x, double limit)
{
    return limit < x ? limit : x < -limit ? -limit : x;
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

void lyapunov_init(lyapunov_state_t *state)
{
    state->unused = 0.0;
}

void lyapunov_step(lyapunov_state_t *state, const lyapunov_input_t *input, lyapunov_command_t *command)
{
    (void)state;
    const state_t known = {.attitude = input->attitude, .rate = input->rate, .position = input->position};
    const scene_t scene = {.goal = inertial_goal(&parameters.setup.target),
        .torque = gravity_gradient_torque(&known, &parameters.craft)};
    const measurement_t measurement = observe(&known, &scene);
    const vector_t wanted = limit_axis(lyapunov_torque(&measurement, &parameters.gains, &parameters.craft),
        parameters.setup.limit);
    command->torque = wanted;
}
