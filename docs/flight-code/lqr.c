/* lqr.c: made by starhold 0.3.0; see lqr.h. Do not edit: change the scenario and export it again. */

#include "lqr.h"

#if defined(__FAST_MATH__) || (defined(__FLT_EVAL_METHOD__) && __FLT_EVAL_METHOD__ != 0)
#error "this code needs IEEE arithmetic in doubles: no -ffast-math, no x87"
#endif
#if !defined(__GNUC__) || defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif

typedef lqr_quaternion_t quaternion_t;
typedef lqr_vector_t vector_t;

/* Damping and stiffness matrices, and the share of the gyroscopic torque that is cancelled. */
typedef struct {
    vector_t k_rate; /* N m s: damping */
    vector_t k_attitude; /* N m: stiffness */
    double gyroscopic; /* share of w x Jw cancelled */
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
        .k_rate = {0.2, 0.30000000000000004, 0.4}, /* N m s */
        .k_attitude = {0.02, 0.03, 0.04}, /* N m */
        .gyroscopic = 1.0,
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

/* Return a - b. */
static vector_t subtract(vector_t a, vector_t b)
{
    return (vector_t){a.x - b.x, a.y - b.y, a.z - b.z};
}

/* ------------------------------------ laws.interface ------------------------------------ */

/* Return the torque (N m) under which the motion relative to a moving target obeys the equations for a
   target at rest, J w_e' + w_e x J w_e = rest of the torque; zero for a target at rest. */
static vector_t tracking_torque(const measurement_t *measurement, const craft_t *craft)
{
    const vector_t gyroscopic = subtract(gyroscopic_torque(craft->inertia, measurement->body_rate),
        gyroscopic_torque(craft->inertia, measurement->rate));
    return add(gyroscopic, apply(craft->inertia, measurement->target_acceleration));
}

/* --------------------------------------- laws.lqr --------------------------------------- */

/* Return the control torque (N m, body). */
static vector_t lqr_torque(const measurement_t *measurement, const gains_t *gains, const craft_t *craft)
{
    const vector_t feedback = add(apply(gains->k_rate, measurement->rate),
        apply(gains->k_attitude, vector_part(measurement->attitude)));
    const vector_t gyroscopic = scale(gains->gyroscopic,
        gyroscopic_torque(craft->inertia, measurement->rate));
    return subtract(add(tracking_torque(measurement, craft), gyroscopic), feedback);
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

void lqr_init(lqr_state_t *state)
{
    state->unused = 0.0;
}

void lqr_step(lqr_state_t *state, const lqr_input_t *input, lqr_command_t *command)
{
    (void)state;
    const state_t known = {.attitude = input->attitude, .rate = input->rate};
    const scene_t scene = {.goal = inertial_goal(&parameters.setup.target)};
    const measurement_t measurement = observe(&known, &scene);
    const vector_t wanted = limit_axis(lqr_torque(&measurement, &parameters.gains, &parameters.craft),
        parameters.setup.limit);
    command->torque = wanted;
}
