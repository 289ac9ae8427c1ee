/* modal.c: made by starhold 0.3.0; see modal.h. Do not edit: change the scenario and export it again. */

#include "modal.h"

#if defined(__FAST_MATH__) || (defined(__FLT_EVAL_METHOD__) && __FLT_EVAL_METHOD__ != 0)
#error "this code needs IEEE arithmetic in doubles: no -ffast-math, no x87"
#endif
#if !defined(__GNUC__) || defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif

typedef modal_quaternion_t quaternion_t;
typedef modal_vector_t vector_t;

/* The gains are the spectra of the three levels. */
typedef struct {
    vector_t phi_0; /* 1/s: of the rates; a number a stands for a E */
    vector_t phi_1; /* 1/s: of the quaternion's vector part */
    double b; /* s: of its scalar part, over |w|2 */
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
    vector_t torque;
    vector_t momentum;
} scene_t;

/* Quantities that a law reads at a control instant; vectors are in body axes. */
typedef struct {
    quaternion_t attitude; /* rotation from the target axes to the body axes, scalar first */
    vector_t rate; /* rad/s: angular velocity relative to the target */
    vector_t body_rate; /* rad/s: absolute angular velocity */
    vector_t target_acceleration; /* rad/s^2: derivative of target_rate in the rotating body axes */
    vector_t external_torque; /* N m: modelled torque from outside at this attitude */
    vector_t wheel_momentum; /* N m s: angular momentum of the body's wheels */
} measurement_t;

static const parameters_t parameters = {
    .gains = {
        .phi_0 = {-0.42840147464805134, -0.42840147464805134, -0.42840147464805134}, /* 1/s */
        .phi_1 = {-0.42840147464805134, -0.42840147464805134, -0.42840147464805134}, /* 1/s */
        .b = -0.01, /* s */
    },
    .craft = {
        .inertia = {4400.0, 4200.0, 3600.0}, /* kg m^2 */
    },
    .setup = {
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

/* ------------------------------- parts.bodies.rigid_body -------------------------------- */

/* Return the law's measurement of a state from sensors or estimators. */
static measurement_t observe(const state_t *state, const scene_t *scene)
{
    const quaternion_t error = relative(scene->goal.attitude, state->attitude);
    return (measurement_t){.attitude = error, .rate = state->rate, .body_rate = state->rate,
        .target_acceleration = {0.0, 0.0, 0.0}, .external_torque = scene->torque,
        .wheel_momentum = scene->momentum};
}

/* ------------------------------------ algebra.vector ------------------------------------ */

/* Return the scalar product. */
static double dot(vector_t a, vector_t b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

/* ---------------------------------- algebra.quaternion ---------------------------------- */

/* Return dq/dt for the angular velocity `rate` (rad/s, body axes), q' = q (0, rate) / 2. */
static quaternion_t derivative(quaternion_t q, vector_t rate)
{
    const vector_t v = vector_part(q);
    const vector_t d = scale(0.5, add(scale(q.q0, rate), cross(v, rate)));
    return (quaternion_t){-0.5 * dot(rate, v), d.x, d.y, d.z};
}

/* ------------------------------------ algebra.vector ------------------------------------ */

/* Return a - b. */
static vector_t subtract(vector_t a, vector_t b)
{
    return (vector_t){a.x - b.x, a.y - b.y, a.z - b.z};
}

/* -------------------------------------- laws.modal -------------------------------------- */

/* Return D^-1 v with D v = v + q x v. */
static vector_t straighten(vector_t q, vector_t v)
{
    return scale(1.0 / (1.0 + dot(q, q)), add(subtract(v, cross(q, v)), scale(dot(q, v), q)));
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

/* -------------------------------------- laws.modal -------------------------------------- */

/* Return K_1 (first, rest), which would give the quaternion the spectra phi_1 and b |w|^2 if the momentum
   were its input. */
static vector_t upper(vector_t q, vector_t w, const gains_t *gains, const craft_t *craft, double first,
    vector_t rest)
{
    const vector_t half = apply(craft->inertia, straighten(q, w));
    const vector_t doubled = scale(2.0, apply(craft->inertia, straighten(q, rest)));
    const vector_t last = scale(4.0 * gains->b, half);
    const vector_t pulled = apply(gains->phi_1, add(scale(first, last), doubled));
    return subtract(subtract(scale(first, half), scale(0.5 * dot(w, rest), last)), pulled);
}

/* ------------------------------------ algebra.vector ------------------------------------ */

/* Return a x (m a) for a symmetric m: the gyroscopic torque is gyroscopic_torque(J, w). */
static vector_t gyroscopic_torque(vector_t m, vector_t a)
{
    return (vector_t){(m.z - m.y) * (a.y * a.z), (m.x - m.z) * (a.z * a.x), (m.y - m.x) * (a.x * a.y)};
}

/* -------------------------------------- laws.modal -------------------------------------- */

/* Return the control torque (N m, body). */
static vector_t modal_torque(const measurement_t *measurement, const gains_t *gains, const craft_t *craft)
{
    const vector_t q = vector_part(measurement->attitude);
    const quaternion_t turning = derivative(measurement->attitude, measurement->rate);
    const vector_t steered = upper(q, measurement->rate, gains, craft, measurement->attitude.q0 - 1.0, q);
    const vector_t moved = upper(q, measurement->rate, gains, craft, turning.q0, vector_part(turning));
    const vector_t feedback = subtract(moved, apply(gains->phi_0,
        add(steered, apply(craft->inertia, measurement->rate))));
    const vector_t add_result = add(add(gyroscopic_torque(craft->inertia, measurement->body_rate),
        cross(measurement->body_rate, measurement->wheel_momentum)),
        apply(craft->inertia, measurement->target_acceleration));
    const vector_t model = subtract(add_result, measurement->external_torque);
    return subtract(model, feedback);
}

/* -------------------------------------- interface --------------------------------------- */

void modal_init(modal_state_t *state)
{
    state->unused = 0.0;
}

void modal_step(modal_state_t *state, const modal_input_t *input, modal_command_t *command)
{
    (void)state;
    const state_t known = {.attitude = input->attitude, .rate = input->rate};
    const scene_t scene = {.goal = inertial_goal(&parameters.setup.target), .torque = {0.0, 0.0, 0.0},
        .momentum = {0.0, 0.0, 0.0}};
    const measurement_t measurement = observe(&known, &scene);
    command->torque = modal_torque(&measurement, &parameters.gains, &parameters.craft);
}
