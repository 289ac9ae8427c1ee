/* mpc.c: made by starhold 0.3.0; see mpc.h. Do not edit: change the scenario and export it again. */

#include "mpc.h"

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#if defined(__FAST_MATH__) || (defined(__FLT_EVAL_METHOD__) && __FLT_EVAL_METHOD__ != 0)
#error "this code needs IEEE arithmetic in doubles: no -ffast-math, no x87"
#endif
#if !defined(__GNUC__) || defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif

typedef mpc_quaternion_t quaternion_t;
typedef mpc_vector_t vector_t;

/* Rows of a 3x3 matrix. */
typedef struct {
    vector_t row[3];
} matrix_t;

/* A rigid spacecraft. */
typedef struct {
    vector_t inertia; /* kg m^2: of a craft with wheels without their rotors' about their axes */
    vector_t inverse_inertia; /* 1/(kg m^2): its inverse */
    /* N m: available to a law, per axis or in norm; infinite for none; with wheels at most their torque */
    double torque_limit;
    double gravity; /* m^3/s^2: gravitational parameter of the body that it orbits */
} craft_t;

/* The attitude of the target. */
typedef struct {
    quaternion_t attitude; /* unit quaternion, scalar first */
} inertial_params_t;

/* The numbers of a loop besides those of craft and law, an argument of kernels. */
typedef struct {
    double period;
    double limit;
    inertial_params_t target;
} setup_t;

/* Constants of the flight code. */
typedef struct {
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

/* The inputs of a measurement besides the state: the goal (None without a target), whether it never turns,
   the modelled external torque (N m, body), the effectors' momentum (N m s, body), the control period (s),
   the limit of the command, and all readings of the sensors, one attribute each. */
typedef struct {
    goal_t goal;
    double period;
} scene_t;

/* Quantities that a law reads at a control instant; vectors are in body axes. */
typedef struct {
    quaternion_t attitude; /* rotation from the target axes to the body axes, scalar first */
    vector_t rate; /* rad/s: angular velocity relative to the target */
    vector_t body_rate; /* rad/s: absolute angular velocity */
    vector_t target_acceleration; /* rad/s^2: derivative of target_rate in the rotating body axes */
    vector_t position; /* m: from the centre of attraction */
    double period; /* s: for which the torque will be held */
} measurement_t;

/* The motion x' = A x + B u for small x = (q; w) about the measured motion, in blocks of three: A =
   [[turning, E/2], [stiffness, damping]], B = [0; push]. */
typedef struct {
    matrix_t turning;
    matrix_t stiffness;
    matrix_t damping;
    matrix_t push;
} linear_t;

/* The blocks of A of `Linear` times some time: [[turning, half E], [stiffness, damping]]. */
typedef struct {
    matrix_t turning;
    double half;
    matrix_t stiffness;
    matrix_t damping;
} rates_t;

typedef struct {
    double e[6];
} doubles6_t;

typedef struct {
    doubles6_t e[6];
} doubles6s6_t;

/* What share gives. */
typedef struct {
    double scalar;
    double scalar1;
} share_result_t;

/* Limits of a move v: |v - centre| <= bound (N m; inf: none), in norm (ball) or on each axis, low <= v <=
   high. */
typedef struct {
    vector_t centre;
    double bound;
    vector_t low;
    vector_t high;
} limits_t;

/* What project gives. */
typedef struct {
    vector_t vector;
    bool truth;
} project_result_t;

typedef struct {
    vector_t e[6];
} vectors6_t;

/* What motion gives. */
typedef struct {
    doubles6s6_t rows;
    vectors6_t rows1;
} motion_result_t;

/* The weights Q and R, full or as their diagonals, the inverse of R, and P. */
typedef struct {
    doubles6_t q;
    vector_t r;
    vector_t r_inverse;
    doubles6s6_t p;
} weights_t;

typedef struct {
    doubles6_t e[3];
} doubles6s3_t;

/* What repelled gives. */
typedef struct {
    doubles6_t symmetric;
    vector_t push;
} repelled_result_t;

typedef struct {
    bool e[3];
} bools3_t;

/* What held_inverse gives. */
typedef struct {
    doubles6_t symmetric;
    double scalar;
} held_inverse_result_t;

/* What sweep gives. */
typedef struct {
    double scalar;
    double scalar1;
} sweep_result_t;

/* A trial plan: whether a limit cut a move, and the change of half the cost, slope + curvature / 2, which
   avoids the cancellation in a difference of two costs. */
typedef struct {
    bool cut;
    double change;
} trial_t;

/* Progress of a run: half the cost of the plan, the sweeps so far, whether the interior-point method has
   been used, whether the run is over, and the fields of `Solved` so far. */
typedef struct {
    double half;
    double sweeps;
    bool rescued;
    bool over;
    bool solved;
    bool shaped;
} progress_t;

/* Result of a Newton step, and whether the interior-point method is to be used. */
typedef struct {
    progress_t progress;
    bool rescue;
} attempt_t;

/* The state of the method: the barrier parameter, the sweeps so far, and whether it has ended. */
typedef struct {
    double barrier;
    double sweeps;
    bool done;
} turn_t;

/* What interior gives. */
typedef struct {
    double scalar;
    double scalar1;
} interior_result_t;

/* Result of a run: the number of Riccati sweeps, whether the optimum was reached, and whether limits are
   active. */
typedef struct {
    double sweeps;
    bool solved;
    bool shaped;
} solved_t;

static const parameters_t parameters = {
    .craft = {
        .inertia = {2.0, 3.0, 4.0}, /* kg m^2 */
        .inverse_inertia = {0.5, 0.3333333333333333, 0.25}, /* 1/(kg m^2) */
        .torque_limit = 0.01, /* N m */
        .gravity = 398600000000000.0, /* m^3/s^2 */
    },
    .setup = {
        .period = 0.1,
        .limit = 0.01,
        .target = {
            .attitude = {1.0, 0.0, 0.0, 0.0},
        },
    },
};

/* Where the parts of numbers begin. */
enum {
    COUNTERS_AT = 0,
    WEIGHTS_AT = 5,
    TAIL_AT = 53,
    MOTION_AT = 71,
    LIMITS_AT = 125,
    MEAN_AT = 129,
    TERM_AT = 165,
    PLAN_AT = 201,
    STATES_AT = 231,
    GRADIENT_AT = 297,
    STEP_AT = 327,
    FEEDBACK_AT = 357,
    STIFFNESS_AT = 537,
    TRIAL_AT = 547,
    BEND_AT = 577,
    MULTIPLIERS_AT = 637,
    SPARE_AT = 667,
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
    const vector_t position = to_body(state->attitude, state->position);
    return (measurement_t){.attitude = error, .rate = state->rate, .body_rate = state->rate,
        .target_acceleration = {0.0, 0.0, 0.0}, .position = position, .period = scene->period};
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

/* ------------------------------------ laws.interface ------------------------------------ */

/* Return the torque (N m) under which the motion relative to a moving target obeys the equations for a
   target at rest, J w_e' + w_e x J w_e = rest of the torque; zero for a target at rest. */
static vector_t tracking_torque(const measurement_t *measurement, const craft_t *craft)
{
    const vector_t gyroscopic = subtract(gyroscopic_torque(craft->inertia, measurement->body_rate),
        gyroscopic_torque(craft->inertia, measurement->rate));
    return add(gyroscopic, apply(craft->inertia, measurement->target_acceleration));
}

/* ------------------------------------ algebra.vector ------------------------------------ */

/* Return [a]x, the matrix of the vector product: apply(skew(a), b) = a x b. */
static matrix_t skew(vector_t a)
{
    return (matrix_t){{{0.0, -a.z, a.y}, {a.z, 0.0, -a.x}, {-a.y, a.x, 0.0}}};
}

/* Return the transposed matrix. */
static matrix_t transpose(matrix_t m)
{
    return (matrix_t){{{m.row[0].x, m.row[1].x, m.row[2].x}, {m.row[0].y, m.row[1].y, m.row[2].y},
        {m.row[0].z, m.row[1].z, m.row[2].z}}};
}

/* -------------------------------- laws.predictive.motion -------------------------------- */

/* Return the motion linearised about the measurement (SI units). */
static linear_t linearise(const measurement_t *measurement, const craft_t *craft)
{
    const vector_t momentum = apply(craft->inertia, measurement->rate);
    const vector_t pull = apply(total_inertia(craft), measurement->position);
    const double square = dot(measurement->position, measurement->position);
    const double strength = 0.0 < square ? 6.0 * craft->gravity / (square * square * sqrt(square)) : 0.0;
    const vector_t lever = cross(measurement->position, (vector_t){1.0, 0.0, 0.0});
    const vector_t scale_result = scale(strength, apply(craft->inverse_inertia,
        subtract(cross(measurement->position, apply(total_inertia(craft), lever)), cross(pull, lever))));
    const vector_t lever_2 = cross(measurement->position, (vector_t){0.0, 1.0, 0.0});
    const vector_t scale_result_2 = scale(strength, apply(craft->inverse_inertia,
        subtract(cross(measurement->position, apply(total_inertia(craft), lever_2)), cross(pull, lever_2))));
    const vector_t lever_3 = cross(measurement->position, (vector_t){0.0, 0.0, 1.0});
    const vector_t tilt = subtract(cross(measurement->position, apply(total_inertia(craft), lever_3)),
        cross(pull, lever_3));
    const vector_t apply_result = apply(craft->inverse_inertia,
        subtract(cross(momentum, (vector_t){1.0, 0.0, 0.0}), cross(measurement->rate,
        apply(craft->inertia, (vector_t){1.0, 0.0, 0.0}))));
    const vector_t apply_result_2 = apply(craft->inverse_inertia,
        subtract(cross(momentum, (vector_t){0.0, 1.0, 0.0}), cross(measurement->rate,
        apply(craft->inertia, (vector_t){0.0, 1.0, 0.0}))));
    const vector_t apply_result_3 = apply(craft->inverse_inertia,
        subtract(cross(momentum, (vector_t){0.0, 0.0, 1.0}), cross(measurement->rate,
        apply(craft->inertia, (vector_t){0.0, 0.0, 1.0}))));
    const matrix_t push = transpose((matrix_t){{apply(craft->inverse_inertia, (vector_t){1.0, 0.0, 0.0}),
        apply(craft->inverse_inertia, (vector_t){0.0, 1.0, 0.0}),
        apply(craft->inverse_inertia, (vector_t){0.0, 0.0, 1.0})}});
    return (linear_t){.turning = transpose(skew(measurement->rate)), .stiffness =
        transpose((matrix_t){{scale_result, scale_result_2,
        scale(strength, apply(craft->inverse_inertia, tilt))}}), .damping =
        transpose((matrix_t){{apply_result, apply_result_2, apply_result_3}}), .push = push};
}

static matrix_t scaled(matrix_t m, double c)
{
    return (matrix_t){{scale(c, m.row[0]), scale(c, m.row[1]), scale(c, m.row[2])}};
}

/* Return the whole matrix. */
static doubles6s6_t rows(const rates_t *rates)
{
    return (doubles6s6_t){{{{0.0, rates->turning.row[0].y, rates->turning.row[0].z, rates->half, 0.0, 0.0}},
        {{rates->turning.row[1].x, 0.0, rates->turning.row[1].z, 0.0, rates->half, 0.0}},
        {{rates->turning.row[2].x, rates->turning.row[2].y, 0.0, 0.0, 0.0, rates->half}},
        {{rates->stiffness.row[0].x, rates->stiffness.row[0].y, rates->stiffness.row[0].z,
        rates->damping.row[0].x, rates->damping.row[0].y, rates->damping.row[0].z}},
        {{rates->stiffness.row[1].x, rates->stiffness.row[1].y, rates->stiffness.row[1].z,
        rates->damping.row[1].x, rates->damping.row[1].y, rates->damping.row[1].z}},
        {{rates->stiffness.row[2].x, rates->stiffness.row[2].y, rates->stiffness.row[2].z,
        rates->damping.row[2].x, rates->damping.row[2].y, rates->damping.row[2].z}}}};
}

/* ------------------------------------ algebra.scalar ------------------------------------ */

/* Return |x|. */
static double absolute(double x)
{
    return x < 0.0 ? -x : x;
}

/* Return the larger. */
static double maximum(double a, double b)
{
    return b < a ? a : b;
}

/* -------------------------------- laws.predictive.motion -------------------------------- */

/* Return the share of the period, halved until no row's absolute sum exceeds 1, and the number of
   halvings. */
static share_result_t share_1(const rates_t *rates)
{
    const doubles6s6_t rows_result = rows(rates);
    const double t3 = 0.0 + absolute(rows_result.e[0].e[0]) + absolute(rows_result.e[0].e[1]) +
        absolute(rows_result.e[0].e[2]);
    const double t6 = t3 + absolute(rows_result.e[0].e[3]) + absolute(rows_result.e[0].e[4]) +
        absolute(rows_result.e[0].e[5]);
    const double t9 = 0.0 + absolute(rows_result.e[1].e[0]) + absolute(rows_result.e[1].e[1]) +
        absolute(rows_result.e[1].e[2]);
    const double t12 = t9 + absolute(rows_result.e[1].e[3]) + absolute(rows_result.e[1].e[4]) +
        absolute(rows_result.e[1].e[5]);
    const double t15 = 0.0 + absolute(rows_result.e[2].e[0]) + absolute(rows_result.e[2].e[1]) +
        absolute(rows_result.e[2].e[2]);
    const double t18 = t15 + absolute(rows_result.e[2].e[3]) + absolute(rows_result.e[2].e[4]) +
        absolute(rows_result.e[2].e[5]);
    const double t21 = 0.0 + absolute(rows_result.e[3].e[0]) + absolute(rows_result.e[3].e[1]) +
        absolute(rows_result.e[3].e[2]);
    const double t24 = t21 + absolute(rows_result.e[3].e[3]) + absolute(rows_result.e[3].e[4]) +
        absolute(rows_result.e[3].e[5]);
    const double t27 = 0.0 + absolute(rows_result.e[4].e[0]) + absolute(rows_result.e[4].e[1]) +
        absolute(rows_result.e[4].e[2]);
    const double t30 = t27 + absolute(rows_result.e[4].e[3]) + absolute(rows_result.e[4].e[4]) +
        absolute(rows_result.e[4].e[5]);
    const double t33 = 0.0 + absolute(rows_result.e[5].e[0]) + absolute(rows_result.e[5].e[1]) +
        absolute(rows_result.e[5].e[2]);
    const double total = t33 + absolute(rows_result.e[5].e[3]) + absolute(rows_result.e[5].e[4]) +
        absolute(rows_result.e[5].e[5]);
    const double size_2 = maximum(total, maximum(t30,
        maximum(t24, maximum(t18, maximum(t12, maximum(t6, 0.0))))));
    double size_ = size_2;
    double share_ = 1.0;
    double count_ = 0.0;
    for (int32_t turn = 0; turn < 60; turn++) {
        const double size = size_;
        const double share = share_;
        const double count = count_;
        if (!(1.0 < size)) break;
        size_ = 0.5 * size;
        share_ = 0.5 * share;
        count_ = count + 1.0;
    }
    return (share_result_t){.scalar = share_, .scalar1 = count_};
}

/* Return the rates times that share of the time. */
static rates_t during(const rates_t *rates, double share)
{
    return (rates_t){.turning = scaled(rates->turning, share), .half = rates->half * share,
        .stiffness = scaled(rates->stiffness, share), .damping = scaled(rates->damping, share)};
}

/* -------------------------------- laws.predictive.sixes --------------------------------- */

/* Return the transposed matrix. */
static doubles6s6_t transposed(doubles6s6_t m)
{
    return (doubles6s6_t){{{{m.e[0].e[0], m.e[1].e[0], m.e[2].e[0], m.e[3].e[0], m.e[4].e[0], m.e[5].e[0]}},
        {{m.e[0].e[1], m.e[1].e[1], m.e[2].e[1], m.e[3].e[1], m.e[4].e[1], m.e[5].e[1]}}, {{m.e[0].e[2],
        m.e[1].e[2], m.e[2].e[2], m.e[3].e[2], m.e[4].e[2], m.e[5].e[2]}}, {{m.e[0].e[3], m.e[1].e[3],
        m.e[2].e[3], m.e[3].e[3], m.e[4].e[3], m.e[5].e[3]}}, {{m.e[0].e[4], m.e[1].e[4], m.e[2].e[4],
        m.e[3].e[4], m.e[4].e[4], m.e[5].e[4]}}, {{m.e[0].e[5], m.e[1].e[5], m.e[2].e[5], m.e[3].e[5],
        m.e[4].e[5], m.e[5].e[5]}}}};
}

/* -------------------------------- laws.predictive.motion -------------------------------- */

static doubles6_t times1(doubles6_t row, double c)
{
    return (doubles6_t){{row.e[0] * c, row.e[1] * c, row.e[2] * c, row.e[3] * c, row.e[4] * c, row.e[5] * c}};
}

/* -------------------------------- laws.predictive.sixes --------------------------------- */

/* Return start + a'b. */
static double dot1(vector_t a, vector_t b)
{
    const double total = 0.0 + a.x * b.x + a.y * b.y + a.z * b.z;
    return total;
}

/* Return start + a'b. */
static double dot2(doubles6_t a, doubles6_t b)
{
    const double t8 = 0.0 + a.e[0] * b.e[0] + a.e[1] * b.e[1] + a.e[2] * b.e[2] + a.e[3] * b.e[3];
    const double total = t8 + a.e[4] * b.e[4] + a.e[5] * b.e[5];
    return total;
}

/* -------------------------------- laws.predictive.motion -------------------------------- */

/* Return the matrix times a column, without multiplying its zero blocks. */
static doubles6_t product(const rates_t *rates, doubles6_t x)
{
    const doubles6s6_t rows_result = rows(rates);
    return (doubles6_t){{dot1((vector_t){rates->turning.row[0].y, rates->turning.row[0].z, rates->half},
        (vector_t){x.e[1], x.e[2], x.e[3]}), dot1((vector_t){rates->turning.row[1].x, rates->turning.row[1].z,
        rates->half}, (vector_t){x.e[0], x.e[2], x.e[4]}), dot1((vector_t){rates->turning.row[2].x,
        rates->turning.row[2].y, rates->half}, (vector_t){x.e[0], x.e[1], x.e[5]}), dot2(rows_result.e[3], x),
        dot2(rows_result.e[4], x), dot2(rows_result.e[5], x)}};
}

/* -------------------------------- laws.predictive.sixes --------------------------------- */

/* Return a + b. */
static doubles6_t plus(doubles6_t a, doubles6_t b)
{
    return (doubles6_t){{a.e[0] + b.e[0], a.e[1] + b.e[1], a.e[2] + b.e[2], a.e[3] + b.e[3], a.e[4] + b.e[4],
        a.e[5] + b.e[5]}};
}

/* ------------------------------------ algebra.scalar ------------------------------------ */

/* Return the smaller number; a NaN in the second argument is returned. */
static double minimum(double a, double b)
{
    return a < b ? a : b;
}

/* -------------------------------- laws.predictive.motion -------------------------------- */

/* Write the sum of A^k / (k + 1)! from k = 0 on into `mean`, column by column. */
static void sum_up(double *numbers, const rates_t *rates)
{
    const doubles6s6_t transposed_result = transposed(rows(rates));
    const doubles6_t first = times1(transposed_result.e[0], 0.5);
    numbers[TERM_AT] = first.e[0];
    numbers[TERM_AT + 1] = first.e[1];
    numbers[TERM_AT + 2] = first.e[2];
    numbers[TERM_AT + 3] = first.e[3];
    numbers[TERM_AT + 4] = first.e[4];
    numbers[TERM_AT + 5] = first.e[5];
    numbers[MEAN_AT] = 1.0 + first.e[0];
    numbers[MEAN_AT + 1] = first.e[1];
    numbers[MEAN_AT + 2] = first.e[2];
    numbers[MEAN_AT + 3] = first.e[3];
    numbers[MEAN_AT + 4] = first.e[4];
    numbers[MEAN_AT + 5] = first.e[5];
    const doubles6_t first_2 = times1(transposed_result.e[1], 0.5);
    numbers[TERM_AT + 6] = first_2.e[0];
    numbers[TERM_AT + 7] = first_2.e[1];
    numbers[TERM_AT + 8] = first_2.e[2];
    numbers[TERM_AT + 9] = first_2.e[3];
    numbers[TERM_AT + 10] = first_2.e[4];
    numbers[TERM_AT + 11] = first_2.e[5];
    numbers[MEAN_AT + 6] = first_2.e[0];
    numbers[MEAN_AT + 7] = 1.0 + first_2.e[1];
    numbers[MEAN_AT + 8] = first_2.e[2];
    numbers[MEAN_AT + 9] = first_2.e[3];
    numbers[MEAN_AT + 10] = first_2.e[4];
    numbers[MEAN_AT + 11] = first_2.e[5];
    const doubles6_t first_3 = times1(transposed_result.e[2], 0.5);
    numbers[TERM_AT + 12] = first_3.e[0];
    numbers[TERM_AT + 13] = first_3.e[1];
    numbers[TERM_AT + 14] = first_3.e[2];
    numbers[TERM_AT + 15] = first_3.e[3];
    numbers[TERM_AT + 16] = first_3.e[4];
    numbers[TERM_AT + 17] = first_3.e[5];
    numbers[MEAN_AT + 12] = first_3.e[0];
    numbers[MEAN_AT + 13] = first_3.e[1];
    numbers[MEAN_AT + 14] = 1.0 + first_3.e[2];
    numbers[MEAN_AT + 15] = first_3.e[3];
    numbers[MEAN_AT + 16] = first_3.e[4];
    numbers[MEAN_AT + 17] = first_3.e[5];
    const doubles6_t first_4 = times1(transposed_result.e[3], 0.5);
    numbers[TERM_AT + 18] = first_4.e[0];
    numbers[TERM_AT + 19] = first_4.e[1];
    numbers[TERM_AT + 20] = first_4.e[2];
    numbers[TERM_AT + 21] = first_4.e[3];
    numbers[TERM_AT + 22] = first_4.e[4];
    numbers[TERM_AT + 23] = first_4.e[5];
    numbers[MEAN_AT + 18] = first_4.e[0];
    numbers[MEAN_AT + 19] = first_4.e[1];
    numbers[MEAN_AT + 20] = first_4.e[2];
    numbers[MEAN_AT + 21] = 1.0 + first_4.e[3];
    numbers[MEAN_AT + 22] = first_4.e[4];
    numbers[MEAN_AT + 23] = first_4.e[5];
    const doubles6_t first_5 = times1(transposed_result.e[4], 0.5);
    numbers[TERM_AT + 24] = first_5.e[0];
    numbers[TERM_AT + 25] = first_5.e[1];
    numbers[TERM_AT + 26] = first_5.e[2];
    numbers[TERM_AT + 27] = first_5.e[3];
    numbers[TERM_AT + 28] = first_5.e[4];
    numbers[TERM_AT + 29] = first_5.e[5];
    numbers[MEAN_AT + 24] = first_5.e[0];
    numbers[MEAN_AT + 25] = first_5.e[1];
    numbers[MEAN_AT + 26] = first_5.e[2];
    numbers[MEAN_AT + 27] = first_5.e[3];
    numbers[MEAN_AT + 28] = 1.0 + first_5.e[4];
    numbers[MEAN_AT + 29] = first_5.e[5];
    const doubles6_t first_6 = times1(transposed_result.e[5], 0.5);
    numbers[TERM_AT + 30] = first_6.e[0];
    numbers[TERM_AT + 31] = first_6.e[1];
    numbers[TERM_AT + 32] = first_6.e[2];
    numbers[TERM_AT + 33] = first_6.e[3];
    numbers[TERM_AT + 34] = first_6.e[4];
    numbers[TERM_AT + 35] = first_6.e[5];
    numbers[MEAN_AT + 30] = first_6.e[0];
    numbers[MEAN_AT + 31] = first_6.e[1];
    numbers[MEAN_AT + 32] = first_6.e[2];
    numbers[MEAN_AT + 33] = first_6.e[3];
    numbers[MEAN_AT + 34] = first_6.e[4];
    numbers[MEAN_AT + 35] = 1.0 + first_6.e[5];
    double divisor_ = 3.0;
    bool small_ = 0;
    for (int32_t turn = 0; turn < 28; turn++) {
        const double divisor = divisor_;
        const bool small = small_;
        if (small) break;
        bool small1_ = 1;
        for (int32_t j = 0; j < 6; j++) {
            const bool small1 = small1_;
            const doubles6_t doubles6 = {{numbers[TERM_AT + 6 * j], numbers[TERM_AT + 6 * j + 1],
                numbers[TERM_AT + 6 * j + 2], numbers[TERM_AT + 6 * j + 3], numbers[TERM_AT + 6 * j + 4],
                numbers[TERM_AT + 6 * j + 5]}};
            const doubles6_t product_result = product(rates, doubles6);
            const double t26 = product_result.e[0] / divisor;
            const double t27 = product_result.e[1] / divisor;
            const double t28 = product_result.e[2] / divisor;
            const double t29 = product_result.e[3] / divisor;
            const double t30 = product_result.e[4] / divisor;
            const double t31 = product_result.e[5] / divisor;
            numbers[TERM_AT + 6 * j] = t26;
            numbers[TERM_AT + 6 * j + 1] = t27;
            numbers[TERM_AT + 6 * j + 2] = t28;
            numbers[TERM_AT + 6 * j + 3] = t29;
            numbers[TERM_AT + 6 * j + 4] = t30;
            numbers[TERM_AT + 6 * j + 5] = t31;
            const doubles6_t doubles6_2 = {{numbers[MEAN_AT + 6 * j], numbers[MEAN_AT + 6 * j + 1],
                numbers[MEAN_AT + 6 * j + 2], numbers[MEAN_AT + 6 * j + 3], numbers[MEAN_AT + 6 * j + 4],
                numbers[MEAN_AT + 6 * j + 5]}};
            const doubles6_t entries = {{t26, t27, t28, t29, t30, t31}};
            const doubles6_t plus_result = plus(doubles6_2, entries);
            numbers[MEAN_AT + 6 * j] = plus_result.e[0];
            numbers[MEAN_AT + 6 * j + 1] = plus_result.e[1];
            numbers[MEAN_AT + 6 * j + 2] = plus_result.e[2];
            numbers[MEAN_AT + 6 * j + 3] = plus_result.e[3];
            numbers[MEAN_AT + 6 * j + 4] = plus_result.e[4];
            numbers[MEAN_AT + 6 * j + 5] = plus_result.e[5];
            const double largest = maximum(maximum(maximum(maximum(maximum(t26, t27), t28), t29), t30), t31);
            const double least = minimum(minimum(minimum(minimum(minimum(t26, t27), t28), t29), t30), t31);
            small1_ = small1 && (largest < 1e-21 && -1e-21 < least);
        }
        divisor_ = divisor + 1.0;
        small_ = small1_;
    }
}

/* -------------------------------- laws.predictive.sixes --------------------------------- */

/* Return m x. */
static doubles6_t apply1(doubles6s6_t m, doubles6_t x)
{
    return (doubles6_t){{dot2(m.e[0], x), dot2(m.e[1], x), dot2(m.e[2], x), dot2(m.e[3], x), dot2(m.e[4], x),
        dot2(m.e[5], x)}};
}

/* -------------------------------- laws.predictive.motion -------------------------------- */

/* Double the time: S becomes (S + exp(A) S) / 2 when each is divided by its own time. */
static void double_of(double *numbers, const rates_t *rates)
{
    for (int32_t j = 0; j < 6; j++) {
        const doubles6_t doubles6 = {{numbers[MEAN_AT + 6 * j], numbers[MEAN_AT + 6 * j + 1],
            numbers[MEAN_AT + 6 * j + 2], numbers[MEAN_AT + 6 * j + 3], numbers[MEAN_AT + 6 * j + 4],
            numbers[MEAN_AT + 6 * j + 5]}};
        const doubles6_t product_result = product(rates, doubles6);
        numbers[TERM_AT + 6 * j] = product_result.e[0];
        numbers[TERM_AT + 6 * j + 1] = product_result.e[1];
        numbers[TERM_AT + 6 * j + 2] = product_result.e[2];
        numbers[TERM_AT + 6 * j + 3] = product_result.e[3];
        numbers[TERM_AT + 6 * j + 4] = product_result.e[4];
        numbers[TERM_AT + 6 * j + 5] = product_result.e[5];
    }
    const doubles6_t doubles6_2 = {{numbers[TERM_AT], numbers[TERM_AT + 1], numbers[TERM_AT + 2],
        numbers[TERM_AT + 3], numbers[TERM_AT + 4], numbers[TERM_AT + 5]}};
    const doubles6_t doubles6_3 = {{numbers[TERM_AT + 6], numbers[TERM_AT + 7], numbers[TERM_AT + 8],
        numbers[TERM_AT + 9], numbers[TERM_AT + 10], numbers[TERM_AT + 11]}};
    const doubles6_t doubles6_4 = {{numbers[TERM_AT + 12], numbers[TERM_AT + 13], numbers[TERM_AT + 14],
        numbers[TERM_AT + 15], numbers[TERM_AT + 16], numbers[TERM_AT + 17]}};
    const doubles6_t doubles6_5 = {{numbers[TERM_AT + 18], numbers[TERM_AT + 19], numbers[TERM_AT + 20],
        numbers[TERM_AT + 21], numbers[TERM_AT + 22], numbers[TERM_AT + 23]}};
    const doubles6_t doubles6_6 = {{numbers[TERM_AT + 24], numbers[TERM_AT + 25], numbers[TERM_AT + 26],
        numbers[TERM_AT + 27], numbers[TERM_AT + 28], numbers[TERM_AT + 29]}};
    const doubles6_t doubles6_7 = {{numbers[TERM_AT + 30], numbers[TERM_AT + 31], numbers[TERM_AT + 32],
        numbers[TERM_AT + 33], numbers[TERM_AT + 34], numbers[TERM_AT + 35]}};
    const doubles6s6_t turned = transposed((doubles6s6_t){{doubles6_2, doubles6_3, doubles6_4, doubles6_5,
        doubles6_6, doubles6_7}});
    for (int32_t j1 = 0; j1 < 6; j1++) {
        const double t71 = numbers[MEAN_AT + 6 * j1];
        const double t74 = numbers[MEAN_AT + 6 * j1 + 1];
        const double t77 = numbers[MEAN_AT + 6 * j1 + 2];
        const double t80 = numbers[MEAN_AT + 6 * j1 + 3];
        const double t83 = numbers[MEAN_AT + 6 * j1 + 4];
        const double t86 = numbers[MEAN_AT + 6 * j1 + 5];
        const doubles6_t before = {{t71, t74, t77, t80, t83, t86}};
        const doubles6_t apply1_result = apply1(turned, before);
        numbers[MEAN_AT + 6 * j1] = t71 + 0.5 * apply1_result.e[0];
        numbers[MEAN_AT + 6 * j1 + 1] = t74 + 0.5 * apply1_result.e[1];
        numbers[MEAN_AT + 6 * j1 + 2] = t77 + 0.5 * apply1_result.e[2];
        numbers[MEAN_AT + 6 * j1 + 3] = t80 + 0.5 * apply1_result.e[3];
        numbers[MEAN_AT + 6 * j1 + 4] = t83 + 0.5 * apply1_result.e[4];
        numbers[MEAN_AT + 6 * j1 + 5] = t86 + 0.5 * apply1_result.e[5];
    }
}

static vector_t times2(vector_t row, double c)
{
    return (vector_t){row.x * c, row.y * c, row.z * c};
}

/* Set A and B from S, converted back to seconds. */
static void put_motion(double *numbers, const rates_t *rates, matrix_t push, double period)
{
    const double t7 = numbers[MEAN_AT + 6];
    const double t8 = numbers[MEAN_AT + 7];
    const double t9 = numbers[MEAN_AT + 8];
    const double t10 = numbers[MEAN_AT + 9];
    const double t11 = numbers[MEAN_AT + 10];
    const double t12 = numbers[MEAN_AT + 11];
    const double t13 = numbers[MEAN_AT + 12];
    const double t14 = numbers[MEAN_AT + 13];
    const double t15 = numbers[MEAN_AT + 14];
    const double t16 = numbers[MEAN_AT + 15];
    const double t17 = numbers[MEAN_AT + 16];
    const double t18 = numbers[MEAN_AT + 17];
    const double t19 = numbers[MEAN_AT + 18];
    const double t20 = numbers[MEAN_AT + 19];
    const double t21 = numbers[MEAN_AT + 20];
    const double t22 = numbers[MEAN_AT + 21];
    const double t23 = numbers[MEAN_AT + 22];
    const double t24 = numbers[MEAN_AT + 23];
    const double t25 = numbers[MEAN_AT + 24];
    const double t26 = numbers[MEAN_AT + 25];
    const double t27 = numbers[MEAN_AT + 26];
    const double t28 = numbers[MEAN_AT + 27];
    const double t29 = numbers[MEAN_AT + 28];
    const double t30 = numbers[MEAN_AT + 29];
    const double t31 = numbers[MEAN_AT + 30];
    const double t32 = numbers[MEAN_AT + 31];
    const double t33 = numbers[MEAN_AT + 32];
    const double t34 = numbers[MEAN_AT + 33];
    const double t35 = numbers[MEAN_AT + 34];
    const double t36 = numbers[MEAN_AT + 35];
    const doubles6_t column = {{numbers[MEAN_AT], numbers[MEAN_AT + 1], numbers[MEAN_AT + 2],
        numbers[MEAN_AT + 3], numbers[MEAN_AT + 4], numbers[MEAN_AT + 5]}};
    const doubles6_t column_2 = {{t7, t8, t9, t10, t11, t12}};
    const doubles6_t column_3 = {{t13, t14, t15, t16, t17, t18}};
    const doubles6_t column_4 = {{t19, t20, t21, t22, t23, t24}};
    const doubles6_t column_5 = {{t25, t26, t27, t28, t29, t30}};
    const doubles6_t column_6 = {{t31, t32, t33, t34, t35, t36}};
    const doubles6s6_t a = transposed((doubles6s6_t){{product(rates, column), product(rates, column_2),
        product(rates, column_3), product(rates, column_4), product(rates, column_5),
        product(rates, column_6)}});
    const doubles6s6_t transposed_result = transposed((doubles6s6_t){{column, column_2, column_3, column_4,
        column_5, column_6}});
    const matrix_t transpose_result = transpose(push);
    const vector_t vector = {transposed_result.e[0].e[3], transposed_result.e[0].e[4],
        transposed_result.e[0].e[5]};
    const matrix_t transpose_result_2 = transpose(push);
    const vector_t vector_2 = {transposed_result.e[1].e[3], transposed_result.e[1].e[4],
        transposed_result.e[1].e[5]};
    const matrix_t transpose_result_3 = transpose(push);
    const vector_t vector_3 = {transposed_result.e[2].e[3], transposed_result.e[2].e[4],
        transposed_result.e[2].e[5]};
    const matrix_t transpose_result_4 = transpose(push);
    const vector_t vector_4 = {transposed_result.e[3].e[3], transposed_result.e[3].e[4],
        transposed_result.e[3].e[5]};
    const matrix_t transpose_result_5 = transpose(push);
    const vector_t vector_5 = {transposed_result.e[4].e[3], transposed_result.e[4].e[4],
        transposed_result.e[4].e[5]};
    const matrix_t transpose_result_6 = transpose(push);
    const vector_t vector_6 = {transposed_result.e[5].e[3], transposed_result.e[5].e[4],
        transposed_result.e[5].e[5]};
    const double per = 1.0 / period;
    const vector_t times2_result = times2((vector_t){a.e[0].e[3], a.e[0].e[4], a.e[0].e[5]}, period);
    const vector_t times2_result_2 = times2((vector_t){a.e[1].e[3], a.e[1].e[4], a.e[1].e[5]}, period);
    const vector_t times2_result_3 = times2((vector_t){a.e[2].e[3], a.e[2].e[4], a.e[2].e[5]}, period);
    const vector_t times2_result_4 = times2((vector_t){a.e[3].e[0], a.e[3].e[1], a.e[3].e[2]}, per);
    const vector_t times2_result_5 = times2((vector_t){a.e[4].e[0], a.e[4].e[1], a.e[4].e[2]}, per);
    const vector_t times2_result_6 = times2((vector_t){a.e[5].e[0], a.e[5].e[1], a.e[5].e[2]}, per);
    const vector_t times2_result_7 = times2((vector_t){dot1(vector_4, transpose_result_4.row[0]),
        dot1(vector_4, transpose_result_4.row[1]), dot1(vector_4, transpose_result_4.row[2])}, per);
    const vector_t times2_result_8 = times2((vector_t){dot1(vector_5, transpose_result_5.row[0]),
        dot1(vector_5, transpose_result_5.row[1]), dot1(vector_5, transpose_result_5.row[2])}, per);
    const vector_t row = {dot1(vector_6, transpose_result_6.row[0]),
        dot1(vector_6, transpose_result_6.row[1]), dot1(vector_6, transpose_result_6.row[2])};
    const vector_t times2_result_9 = times2(row, per);
    numbers[MOTION_AT] = 1.0 + a.e[0].e[0];
    numbers[MOTION_AT + 1] = a.e[0].e[1];
    numbers[MOTION_AT + 2] = a.e[0].e[2];
    numbers[MOTION_AT + 3] = times2_result.x;
    numbers[MOTION_AT + 4] = times2_result.y;
    numbers[MOTION_AT + 5] = times2_result.z;
    numbers[MOTION_AT + 6] = a.e[1].e[0];
    numbers[MOTION_AT + 7] = 1.0 + a.e[1].e[1];
    numbers[MOTION_AT + 8] = a.e[1].e[2];
    numbers[MOTION_AT + 9] = times2_result_2.x;
    numbers[MOTION_AT + 10] = times2_result_2.y;
    numbers[MOTION_AT + 11] = times2_result_2.z;
    numbers[MOTION_AT + 12] = a.e[2].e[0];
    numbers[MOTION_AT + 13] = a.e[2].e[1];
    numbers[MOTION_AT + 14] = 1.0 + a.e[2].e[2];
    numbers[MOTION_AT + 15] = times2_result_3.x;
    numbers[MOTION_AT + 16] = times2_result_3.y;
    numbers[MOTION_AT + 17] = times2_result_3.z;
    numbers[MOTION_AT + 18] = times2_result_4.x;
    numbers[MOTION_AT + 19] = times2_result_4.y;
    numbers[MOTION_AT + 20] = times2_result_4.z;
    numbers[MOTION_AT + 21] = 1.0 + a.e[3].e[3];
    numbers[MOTION_AT + 22] = a.e[3].e[4];
    numbers[MOTION_AT + 23] = a.e[3].e[5];
    numbers[MOTION_AT + 24] = times2_result_5.x;
    numbers[MOTION_AT + 25] = times2_result_5.y;
    numbers[MOTION_AT + 26] = times2_result_5.z;
    numbers[MOTION_AT + 27] = a.e[4].e[3];
    numbers[MOTION_AT + 28] = 1.0 + a.e[4].e[4];
    numbers[MOTION_AT + 29] = a.e[4].e[5];
    numbers[MOTION_AT + 30] = times2_result_6.x;
    numbers[MOTION_AT + 31] = times2_result_6.y;
    numbers[MOTION_AT + 32] = times2_result_6.z;
    numbers[MOTION_AT + 33] = a.e[5].e[3];
    numbers[MOTION_AT + 34] = a.e[5].e[4];
    numbers[MOTION_AT + 35] = 1.0 + a.e[5].e[5];
    numbers[MOTION_AT + 36] = dot1(vector, transpose_result.row[0]);
    numbers[MOTION_AT + 37] = dot1(vector, transpose_result.row[1]);
    numbers[MOTION_AT + 38] = dot1(vector, transpose_result.row[2]);
    numbers[MOTION_AT + 39] = dot1(vector_2, transpose_result_2.row[0]);
    numbers[MOTION_AT + 40] = dot1(vector_2, transpose_result_2.row[1]);
    numbers[MOTION_AT + 41] = dot1(vector_2, transpose_result_2.row[2]);
    numbers[MOTION_AT + 42] = dot1(vector_3, transpose_result_3.row[0]);
    numbers[MOTION_AT + 43] = dot1(vector_3, transpose_result_3.row[1]);
    numbers[MOTION_AT + 44] = dot1(vector_3, transpose_result_3.row[2]);
    numbers[MOTION_AT + 45] = times2_result_7.x;
    numbers[MOTION_AT + 46] = times2_result_7.y;
    numbers[MOTION_AT + 47] = times2_result_7.z;
    numbers[MOTION_AT + 48] = times2_result_8.x;
    numbers[MOTION_AT + 49] = times2_result_8.y;
    numbers[MOTION_AT + 50] = times2_result_8.z;
    numbers[MOTION_AT + 51] = times2_result_9.x;
    numbers[MOTION_AT + 52] = times2_result_9.y;
    numbers[MOTION_AT + 53] = times2_result_9.z;
}

/* Sample exactly with a held input: A = exp(A h), B = (integral of exp(A s) over 0..h) B of the problem. */
static void sample(double *numbers, const linear_t *linear, double period)
{
    const double square = period * period;
    const rates_t rates = {.turning = scaled(linear->turning, period), .half = 0.5,
        .stiffness = scaled(linear->stiffness, square), .damping = scaled(linear->damping, period)};
    const share_result_t share_1_result = share_1(&rates);
    const rates_t rates_2 = during(&rates, share_1_result.scalar);
    sum_up(numbers, &rates_2);
    double share_ = share_1_result.scalar;
    double left_ = share_1_result.scalar1;
    for (int32_t turn = 0; turn < 60; turn++) {
        const double share = share_;
        const double left = left_;
        if (left <= 0.0) break;
        const rates_t rates_3 = during(&rates, share);
        double_of(numbers, &rates_3);
        share_ = 2.0 * share;
        left_ = left - 1.0;
    }
    put_motion(numbers, &rates, scaled(linear->push, square), period);
}

/* ------------------------------- laws.predictive.problem -------------------------------- */

/* Set the limits: their centre and their bound (inf: none). */
static void put_limits(double *numbers, vector_t centre, double bound)
{
    numbers[LIMITS_AT] = centre.x;
    numbers[LIMITS_AT + 1] = centre.y;
    numbers[LIMITS_AT + 2] = centre.z;
    numbers[LIMITS_AT + 3] = bound;
}

/* -------------------------------- laws.predictive.sixes --------------------------------- */

/* Return the k-th group of three numbers of a buffer. */
static vector_t triple(double *numbers)
{
    const vector_t vector = {numbers[LIMITS_AT], numbers[LIMITS_AT + 1], numbers[LIMITS_AT + 2]};
    return vector;
}

/* ------------------------------- laws.predictive.problem -------------------------------- */

/* Return the limits of every move. */
static limits_t limits_1(double *numbers)
{
    const vector_t centre = triple(numbers);
    const double bound = numbers[LIMITS_AT + 3];
    const vector_t wide = {bound, bound, bound};
    const limits_t limits = {.centre = centre, .bound = bound, .low = subtract(centre, wide),
        .high = add(centre, wide)};
    return limits;
}

/* -------------------------------- laws.predictive.limits -------------------------------- */

/* Return the point within the limits nearest to v, and whether v was outside. */
static project_result_t project(const limits_t *limits, vector_t v)
{
    const bool t10 = limits->low.x <= v.x && v.x <= limits->high.x && (limits->low.y <= v.y && v.y <=
        limits->high.y);
    return (project_result_t){.vector = {minimum(limits->high.x, maximum(limits->low.x, v.x)),
        minimum(limits->high.y, maximum(limits->low.y, v.y)),
        minimum(limits->high.z, maximum(limits->low.z, v.z))}, .truth = !(t10 && (limits->low.z <= v.z && v.z
        <= limits->high.z))};
}

/* -------------------------------- laws.predictive.solver -------------------------------- */

/* Shift a solved plan by one move; the feedback of the tail gives the last one. */
static void advance(double *numbers)
{
    const limits_t bounds = limits_1(numbers);
    const double t1 = numbers[STATES_AT + 60];
    const double t2 = numbers[STATES_AT + 61];
    const double t3 = numbers[STATES_AT + 62];
    const double t4 = numbers[STATES_AT + 63];
    const double t5 = numbers[STATES_AT + 64];
    const double t6 = numbers[STATES_AT + 65];
    const double t13 = numbers[TAIL_AT];
    const double t14 = numbers[TAIL_AT + 1];
    const double t15 = numbers[TAIL_AT + 2];
    const double t16 = numbers[TAIL_AT + 3];
    const double t17 = numbers[TAIL_AT + 4];
    const double t18 = numbers[TAIL_AT + 5];
    const double t30 = 0.0 + t13 * -t1 + t14 * -t2 + t15 * -t3 + t16 * -t4 + t17 * -t5 + t18 * -t6;
    const double t31 = numbers[TAIL_AT + 6];
    const double t32 = numbers[TAIL_AT + 7];
    const double t33 = numbers[TAIL_AT + 8];
    const double t34 = numbers[TAIL_AT + 9];
    const double t35 = numbers[TAIL_AT + 10];
    const double t36 = numbers[TAIL_AT + 11];
    const double t48 = 0.0 + t31 * -t1 + t32 * -t2 + t33 * -t3 + t34 * -t4 + t35 * -t5 + t36 * -t6;
    const double t49 = numbers[TAIL_AT + 12];
    const double t50 = numbers[TAIL_AT + 13];
    const double t51 = numbers[TAIL_AT + 14];
    const double t52 = numbers[TAIL_AT + 15];
    const double t53 = numbers[TAIL_AT + 16];
    const double t54 = numbers[TAIL_AT + 17];
    const double total = 0.0 + t49 * -t1 + t50 * -t2 + t51 * -t3 + t52 * -t4 + t53 * -t5 + t54 * -t6;
    for (int32_t k = 0; k < 9; k++) {
        const vector_t vector = {numbers[PLAN_AT + 3 * (k + 1)], numbers[PLAN_AT + 3 * (k + 1) + 1],
            numbers[PLAN_AT + 3 * (k + 1) + 2]};
        const project_result_t project_result = project(&bounds, vector);
        numbers[PLAN_AT + 3 * k] = project_result.vector.x;
        numbers[PLAN_AT + 3 * k + 1] = project_result.vector.y;
        numbers[PLAN_AT + 3 * k + 2] = project_result.vector.z;
    }
    const vector_t last = {t30, t48, total};
    const project_result_t project_result_2 = project(&bounds, last);
    numbers[PLAN_AT + 27] = project_result_2.vector.x;
    numbers[PLAN_AT + 28] = project_result_2.vector.y;
    numbers[PLAN_AT + 29] = project_result_2.vector.z;
}

/* -------------------------------- laws.predictive.sixes --------------------------------- */

/* Return the matrix that a buffer holds row by row, of rows of `width`. */
static doubles6s6_t matrix(double *numbers)
{
    const doubles6_t doubles6 = {{numbers[MOTION_AT], numbers[MOTION_AT + 1], numbers[MOTION_AT + 2],
        numbers[MOTION_AT + 3], numbers[MOTION_AT + 4], numbers[MOTION_AT + 5]}};
    const doubles6_t doubles6_2 = {{numbers[MOTION_AT + 6], numbers[MOTION_AT + 7], numbers[MOTION_AT + 8],
        numbers[MOTION_AT + 9], numbers[MOTION_AT + 10], numbers[MOTION_AT + 11]}};
    const doubles6_t doubles6_3 = {{numbers[MOTION_AT + 12], numbers[MOTION_AT + 13], numbers[MOTION_AT + 14],
        numbers[MOTION_AT + 15], numbers[MOTION_AT + 16], numbers[MOTION_AT + 17]}};
    const doubles6_t doubles6_4 = {{numbers[MOTION_AT + 18], numbers[MOTION_AT + 19], numbers[MOTION_AT + 20],
        numbers[MOTION_AT + 21], numbers[MOTION_AT + 22], numbers[MOTION_AT + 23]}};
    const doubles6_t doubles6_5 = {{numbers[MOTION_AT + 24], numbers[MOTION_AT + 25], numbers[MOTION_AT + 26],
        numbers[MOTION_AT + 27], numbers[MOTION_AT + 28], numbers[MOTION_AT + 29]}};
    const doubles6_t doubles6_6 = {{numbers[MOTION_AT + 30], numbers[MOTION_AT + 31], numbers[MOTION_AT + 32],
        numbers[MOTION_AT + 33], numbers[MOTION_AT + 34], numbers[MOTION_AT + 35]}};
    return (doubles6s6_t){{doubles6, doubles6_2, doubles6_3, doubles6_4, doubles6_5, doubles6_6}};
}

/* Return the matrix that a buffer holds row by row, of rows of `width`. */
static vectors6_t matrix1(double *numbers)
{
    const vector_t vector = {numbers[MOTION_AT + 36], numbers[MOTION_AT + 37], numbers[MOTION_AT + 38]};
    const vector_t vector_2 = {numbers[MOTION_AT + 39], numbers[MOTION_AT + 40], numbers[MOTION_AT + 41]};
    const vector_t vector_3 = {numbers[MOTION_AT + 42], numbers[MOTION_AT + 43], numbers[MOTION_AT + 44]};
    const vector_t vector_4 = {numbers[MOTION_AT + 45], numbers[MOTION_AT + 46], numbers[MOTION_AT + 47]};
    const vector_t vector_5 = {numbers[MOTION_AT + 48], numbers[MOTION_AT + 49], numbers[MOTION_AT + 50]};
    const vector_t vector_6 = {numbers[MOTION_AT + 51], numbers[MOTION_AT + 52], numbers[MOTION_AT + 53]};
    return (vectors6_t){{vector, vector_2, vector_3, vector_4, vector_5, vector_6}};
}

/* ------------------------------- laws.predictive.problem -------------------------------- */

/* Return A (6, 6) and B (6, 3). */
static motion_result_t motion(double *numbers)
{
    const doubles6s6_t rows_2 = matrix(numbers);
    const vectors6_t rows1 = matrix1(numbers);
    return (motion_result_t){.rows = rows_2, .rows1 = rows1};
}

/* -------------------------------- laws.predictive.sixes --------------------------------- */

/* Return the matrix that a buffer holds row by row, of rows of `width`. */
static doubles6s6_t matrix2(double *numbers)
{
    const doubles6_t doubles6 = {{numbers[WEIGHTS_AT + 12], numbers[WEIGHTS_AT + 13],
        numbers[WEIGHTS_AT + 14], numbers[WEIGHTS_AT + 15], numbers[WEIGHTS_AT + 16],
        numbers[WEIGHTS_AT + 17]}};
    const doubles6_t doubles6_2 = {{numbers[WEIGHTS_AT + 18], numbers[WEIGHTS_AT + 19],
        numbers[WEIGHTS_AT + 20], numbers[WEIGHTS_AT + 21], numbers[WEIGHTS_AT + 22],
        numbers[WEIGHTS_AT + 23]}};
    const doubles6_t doubles6_3 = {{numbers[WEIGHTS_AT + 24], numbers[WEIGHTS_AT + 25],
        numbers[WEIGHTS_AT + 26], numbers[WEIGHTS_AT + 27], numbers[WEIGHTS_AT + 28],
        numbers[WEIGHTS_AT + 29]}};
    const doubles6_t doubles6_4 = {{numbers[WEIGHTS_AT + 30], numbers[WEIGHTS_AT + 31],
        numbers[WEIGHTS_AT + 32], numbers[WEIGHTS_AT + 33], numbers[WEIGHTS_AT + 34],
        numbers[WEIGHTS_AT + 35]}};
    const doubles6_t doubles6_5 = {{numbers[WEIGHTS_AT + 36], numbers[WEIGHTS_AT + 37],
        numbers[WEIGHTS_AT + 38], numbers[WEIGHTS_AT + 39], numbers[WEIGHTS_AT + 40],
        numbers[WEIGHTS_AT + 41]}};
    const doubles6_t doubles6_6 = {{numbers[WEIGHTS_AT + 42], numbers[WEIGHTS_AT + 43],
        numbers[WEIGHTS_AT + 44], numbers[WEIGHTS_AT + 45], numbers[WEIGHTS_AT + 46],
        numbers[WEIGHTS_AT + 47]}};
    return (doubles6s6_t){{doubles6, doubles6_2, doubles6_3, doubles6_4, doubles6_5, doubles6_6}};
}

/* ------------------------------- laws.predictive.problem -------------------------------- */

/* Return the weights of the cost. */
static weights_t weights(double *numbers)
{
    const double t1 = numbers[WEIGHTS_AT];
    const double t2 = numbers[WEIGHTS_AT + 1];
    const double t3 = numbers[WEIGHTS_AT + 2];
    const double t4 = numbers[WEIGHTS_AT + 3];
    const double t5 = numbers[WEIGHTS_AT + 4];
    const double t6 = numbers[WEIGHTS_AT + 5];
    const double t7 = numbers[WEIGHTS_AT + 6];
    const double t8 = numbers[WEIGHTS_AT + 7];
    const double t9 = numbers[WEIGHTS_AT + 8];
    const double t10 = numbers[WEIGHTS_AT + 9];
    const double t11 = numbers[WEIGHTS_AT + 10];
    const double t12 = numbers[WEIGHTS_AT + 11];
    const doubles6s6_t p = matrix2(numbers);
    return (weights_t){.q = {{t1, t2, t3, t4, t5, t6}}, .r = {t7, t8, t9}, .r_inverse = {t10, t11, t12},
        .p = p};
}

/* -------------------------------- laws.predictive.sixes --------------------------------- */

/* Return the transposed matrix. */
static doubles6s3_t transposed1(vectors6_t m)
{
    return (doubles6s3_t){{{{m.e[0].x, m.e[1].x, m.e[2].x, m.e[3].x, m.e[4].x, m.e[5].x}},
        {{m.e[0].y, m.e[1].y, m.e[2].y, m.e[3].y, m.e[4].y, m.e[5].y}},
        {{m.e[0].z, m.e[1].z, m.e[2].z, m.e[3].z, m.e[4].z, m.e[5].z}}}};
}

/* Return m n. */
static doubles6s6_t product1(doubles6s6_t m, doubles6s6_t n)
{
    const doubles6s6_t columns = transposed(n);
    return (doubles6s6_t){{apply1(columns, m.e[0]), apply1(columns, m.e[1]), apply1(columns, m.e[2]),
        apply1(columns, m.e[3]), apply1(columns, m.e[4]), apply1(columns, m.e[5])}};
}

/* Return m x. */
static vector_t apply2(doubles6s3_t m, doubles6_t x)
{
    return (vector_t){dot2(m.e[0], x), dot2(m.e[1], x), dot2(m.e[2], x)};
}

/* Return m n. */
static vectors6_t product2(doubles6s6_t m, vectors6_t n)
{
    const doubles6s3_t columns = transposed1(n);
    return (vectors6_t){{apply2(columns, m.e[0]), apply2(columns, m.e[1]), apply2(columns, m.e[2]),
        apply2(columns, m.e[3]), apply2(columns, m.e[4]), apply2(columns, m.e[5])}};
}

/* Return the transposed matrix. */
static vectors6_t transposed2(doubles6s3_t m)
{
    return (vectors6_t){{{m.e[0].e[0], m.e[1].e[0], m.e[2].e[0]}, {m.e[0].e[1], m.e[1].e[1], m.e[2].e[1]},
        {m.e[0].e[2], m.e[1].e[2], m.e[2].e[2]}, {m.e[0].e[3], m.e[1].e[3], m.e[2].e[3]},
        {m.e[0].e[4], m.e[1].e[4], m.e[2].e[4]}, {m.e[0].e[5], m.e[1].e[5], m.e[2].e[5]}}};
}

/* Return the number in row i and column j. */
static double entry(vector_t m)
{
    return m.x;
}

/* Return start + a'b. */
static double dot3(doubles6_t a, doubles6_t b, double start)
{
    const double t8 = start + a.e[0] * b.e[0] + a.e[1] * b.e[1] + a.e[2] * b.e[2] + a.e[3] * b.e[3];
    const double total = t8 + a.e[4] * b.e[4] + a.e[5] * b.e[5];
    return total;
}

/* Return the number in row i and column j. */
static double entry1(vector_t m)
{
    return m.y;
}

/* Return the number in row i and column j. */
static double entry2(vector_t m)
{
    return m.z;
}

/* ------------------------------- laws.predictive.horizon -------------------------------- */

/* Return R + B'P B. */
static doubles6_t curvature_1(vector_t r, doubles6s3_t pushes, doubles6s3_t pushed)
{
    return (doubles6_t){{dot3(pushes.e[0], pushed.e[0], entry(r)), dot3(pushes.e[0], pushed.e[1], 0.0),
        dot3(pushes.e[0], pushed.e[2], 0.0), dot3(pushes.e[1], pushed.e[1], entry1(r)),
        dot3(pushes.e[1], pushed.e[2], 0.0), dot3(pushes.e[2], pushed.e[2], entry2(r))}};
}

/* -------------------------------- laws.predictive.limits -------------------------------- */

/* Return (bound^2 - d^2)/2 for d = v - centre on each axis of a box, or three times that of a ball;
   positive inside. */
static vector_t slack(const limits_t *limits, vector_t v)
{
    const vector_t d = subtract(v, limits->centre);
    return (vector_t){0.5 * (limits->bound - d.x) * (limits->bound + d.x),
        0.5 * (limits->bound - d.y) * (limits->bound + d.y),
        0.5 * (limits->bound - d.z) * (limits->bound + d.z)};
}

/* Return a symmetric matrix plus the curvature of the barrier, and the barrier's gradient: the
   interior-point step. */
static repelled_result_t repelled(const limits_t *limits, vector_t v, vector_t multipliers, double barrier,
    doubles6_t m)
{
    const vector_t d = subtract(v, limits->centre);
    const vector_t s = slack(limits, v);
    const vector_t push = times((vector_t){barrier / s.x, barrier / s.y, barrier / s.z}, d);
    return (repelled_result_t){.symmetric = {{m.e[0] + multipliers.x * (1.0 + d.x * d.x / s.x), m.e[1],
        m.e[2], m.e[3] + multipliers.y * (1.0 + d.y * d.y / s.y), m.e[4],
        m.e[5] + multipliers.z * (1.0 + d.z * d.z / s.z)}}, .push = push};
}

/* Return which axes of a box press against a limit, for the gradient g. */
static bools3_t pressing(const limits_t *limits, vector_t v, vector_t g)
{
    const bool t7 = (g.x < 0.0 && limits->high.x <= v.x) || (0.0 < g.x && v.x <= limits->low.x);
    const bool t14 = (g.y < 0.0 && limits->high.y <= v.y) || (0.0 < g.y && v.y <= limits->low.y);
    const bool above = g.z < 0.0 && limits->high.z <= v.z;
    return (bools3_t){{t7, t14, above || (0.0 < g.z && v.z <= limits->low.z)}};
}

/* Return the inverse of a symmetric matrix. */
static doubles6_t inverse(doubles6_t m)
{
    const double c0 = m.e[3] * m.e[5] - m.e[4] * m.e[4];
    const double c1 = m.e[2] * m.e[4] - m.e[1] * m.e[5];
    const double c2 = m.e[1] * m.e[4] - m.e[2] * m.e[3];
    const double s = 1.0 / (m.e[0] * c0 + m.e[1] * c1 + m.e[2] * c2);
    const double d0 = m.e[0] * m.e[5] - m.e[2] * m.e[2];
    const double d1 = m.e[1] * m.e[2] - m.e[0] * m.e[4];
    return (doubles6_t){{s * c0, s * c1, s * c2, s * d0, s * d1, s * (m.e[0] * m.e[3] - m.e[1] * m.e[1])}};
}

/* Return the inverse of a symmetric matrix on the axes that are not fixed, zero on the others. */
static doubles6_t box_inverse(doubles6_t m, bools3_t fixed)
{
    const doubles6_t w = inverse((doubles6_t){{fixed.e[0] ? 1.0 : m.e[0],
        fixed.e[0] || fixed.e[1] ? 0.0 : m.e[1], fixed.e[0] || fixed.e[2] ? 0.0 : m.e[2],
        fixed.e[1] ? 1.0 : m.e[3], fixed.e[1] || fixed.e[2] ? 0.0 : m.e[4], fixed.e[2] ? 1.0 : m.e[5]}});
    return (doubles6_t){{fixed.e[0] ? 0.0 : w.e[0], w.e[1], w.e[2], fixed.e[1] ? 0.0 : w.e[3], w.e[4],
        fixed.e[2] ? 0.0 : w.e[5]}};
}

/* ------------------------------- laws.predictive.horizon -------------------------------- */

/* Return the inverse of m on the free directions, and the number of active limits. */
static held_inverse_result_t held_inverse(const limits_t *bounds, vector_t v, vector_t g, doubles6_t m,
    bool holds)
{
    const bools3_t pressing_result = pressing(bounds, v, g);
    const bool t1 = holds && pressing_result.e[0];
    const bool t2 = holds && pressing_result.e[1];
    const bool t3 = holds && pressing_result.e[2];
    const bools3_t fixed = {{t1, t2, t3}};
    return (held_inverse_result_t){.symmetric = box_inverse(m, fixed),
        .scalar = (t1 ? 1.0 : 0.0) + (t2 ? 1.0 : 0.0) + (t3 ? 1.0 : 0.0)};
}

/* Return -w x. */
static vector_t minus(doubles6_t w, vector_t x)
{
    return (vector_t){-(w.e[0] * x.x + w.e[1] * x.y + w.e[2] * x.z),
        -(w.e[1] * x.x + w.e[3] * x.y + w.e[4] * x.z), -(w.e[2] * x.x + w.e[4] * x.y + w.e[5] * x.z)};
}

/* -------------------------------- laws.predictive.sixes --------------------------------- */

/* Return the number in row i and column j. */
static double entry3(doubles6_t m)
{
    return m.e[0];
}

/* Return start + a'b. */
static double dot4(vector_t a, vector_t b, double start)
{
    const double total = start + a.x * b.x + a.y * b.y + a.z * b.z;
    return total;
}

/* Return the number in row i and column j. */
static double entry4(doubles6_t m)
{
    return m.e[1];
}

/* Return the number in row i and column j. */
static double entry5(doubles6_t m)
{
    return m.e[2];
}

/* Return the number in row i and column j. */
static double entry6(doubles6_t m)
{
    return m.e[3];
}

/* Return the number in row i and column j. */
static double entry7(doubles6_t m)
{
    return m.e[4];
}

/* Return the number in row i and column j. */
static double entry8(doubles6_t m)
{
    return m.e[5];
}

/* ------------------------------- laws.predictive.horizon -------------------------------- */

/* Return the matrix made symmetric: long horizons would amplify the rounding. */
static doubles6s6_t symmetric(doubles6s6_t m)
{
    const double t2 = 0.5 * (m.e[1].e[0] + m.e[0].e[1]);
    const double t4 = 0.5 * (m.e[2].e[0] + m.e[0].e[2]);
    const double t6 = 0.5 * (m.e[3].e[0] + m.e[0].e[3]);
    const double t8 = 0.5 * (m.e[4].e[0] + m.e[0].e[4]);
    const double t10 = 0.5 * (m.e[5].e[0] + m.e[0].e[5]);
    const double t12 = 0.5 * (m.e[2].e[1] + m.e[1].e[2]);
    const double t14 = 0.5 * (m.e[3].e[1] + m.e[1].e[3]);
    const double t16 = 0.5 * (m.e[4].e[1] + m.e[1].e[4]);
    const double t18 = 0.5 * (m.e[5].e[1] + m.e[1].e[5]);
    const double t20 = 0.5 * (m.e[3].e[2] + m.e[2].e[3]);
    const double t22 = 0.5 * (m.e[4].e[2] + m.e[2].e[4]);
    const double t24 = 0.5 * (m.e[5].e[2] + m.e[2].e[5]);
    const double t26 = 0.5 * (m.e[4].e[3] + m.e[3].e[4]);
    const double t28 = 0.5 * (m.e[5].e[3] + m.e[3].e[5]);
    const double t30 = 0.5 * (m.e[5].e[4] + m.e[4].e[5]);
    return (doubles6s6_t){{{{m.e[0].e[0], t2, t4, t6, t8, t10}}, {{t2, m.e[1].e[1], t12, t14, t16, t18}},
        {{t4, t12, m.e[2].e[2], t20, t22, t24}}, {{t6, t14, t20, m.e[3].e[3], t26, t28}},
        {{t8, t16, t22, t26, m.e[4].e[4], t30}}, {{t10, t18, t24, t28, t30, m.e[5].e[5]}}}};
}

/* Compute the Newton step by one backward Riccati sweep, as a policy: step + feedback (x - x of the plan). */
static sweep_result_t sweep(double *numbers, double barrier)
{
    const motion_result_t motion_result = motion(numbers);
    const weights_t weight = weights(numbers);
    const limits_t bounds = limits_1(numbers);
    const doubles6s6_t columns = transposed(motion_result.rows);
    const doubles6s3_t pushes = transposed1(motion_result.rows1);
    const bool holds = barrier <= 0.0;
    double curvature_ = weight.p.e[0].e[0];
    double curvature1_ = weight.p.e[0].e[1];
    double curvature2_ = weight.p.e[0].e[2];
    double curvature3_ = weight.p.e[0].e[3];
    double curvature4_ = weight.p.e[0].e[4];
    double curvature5_ = weight.p.e[0].e[5];
    double curvature6_ = weight.p.e[1].e[0];
    double curvature7_ = weight.p.e[1].e[1];
    double curvature8_ = weight.p.e[1].e[2];
    double curvature9_ = weight.p.e[1].e[3];
    double curvature10_ = weight.p.e[1].e[4];
    double curvature11_ = weight.p.e[1].e[5];
    double curvature12_ = weight.p.e[2].e[0];
    double curvature13_ = weight.p.e[2].e[1];
    double curvature14_ = weight.p.e[2].e[2];
    double curvature15_ = weight.p.e[2].e[3];
    double curvature16_ = weight.p.e[2].e[4];
    double curvature17_ = weight.p.e[2].e[5];
    double curvature18_ = weight.p.e[3].e[0];
    double curvature19_ = weight.p.e[3].e[1];
    double curvature20_ = weight.p.e[3].e[2];
    double curvature21_ = weight.p.e[3].e[3];
    double curvature22_ = weight.p.e[3].e[4];
    double curvature23_ = weight.p.e[3].e[5];
    double curvature24_ = weight.p.e[4].e[0];
    double curvature25_ = weight.p.e[4].e[1];
    double curvature26_ = weight.p.e[4].e[2];
    double curvature27_ = weight.p.e[4].e[3];
    double curvature28_ = weight.p.e[4].e[4];
    double curvature29_ = weight.p.e[4].e[5];
    double curvature30_ = weight.p.e[5].e[0];
    double curvature31_ = weight.p.e[5].e[1];
    double curvature32_ = weight.p.e[5].e[2];
    double curvature33_ = weight.p.e[5].e[3];
    double curvature34_ = weight.p.e[5].e[4];
    double curvature35_ = weight.p.e[5].e[5];
    double slope_ = 0.0;
    double slope1_ = 0.0;
    double slope2_ = 0.0;
    double slope3_ = 0.0;
    double slope4_ = 0.0;
    double slope5_ = 0.0;
    double decrement_ = 0.0;
    double holding_ = 0.0;
    for (int32_t back = 0; back < 10; back++) {
        const double curvature = curvature_;
        const double curvature1 = curvature1_;
        const double curvature2 = curvature2_;
        const double curvature3 = curvature3_;
        const double curvature4 = curvature4_;
        const double curvature5 = curvature5_;
        const double curvature6 = curvature6_;
        const double curvature7 = curvature7_;
        const double curvature8 = curvature8_;
        const double curvature9 = curvature9_;
        const double curvature10 = curvature10_;
        const double curvature11 = curvature11_;
        const double curvature12 = curvature12_;
        const double curvature13 = curvature13_;
        const double curvature14 = curvature14_;
        const double curvature15 = curvature15_;
        const double curvature16 = curvature16_;
        const double curvature17 = curvature17_;
        const double curvature18 = curvature18_;
        const double curvature19 = curvature19_;
        const double curvature20 = curvature20_;
        const double curvature21 = curvature21_;
        const double curvature22 = curvature22_;
        const double curvature23 = curvature23_;
        const double curvature24 = curvature24_;
        const double curvature25 = curvature25_;
        const double curvature26 = curvature26_;
        const double curvature27 = curvature27_;
        const double curvature28 = curvature28_;
        const double curvature29 = curvature29_;
        const double curvature30 = curvature30_;
        const double curvature31 = curvature31_;
        const double curvature32 = curvature32_;
        const double curvature33 = curvature33_;
        const double curvature34 = curvature34_;
        const double curvature35 = curvature35_;
        const double slope = slope_;
        const double slope1 = slope1_;
        const double slope2 = slope2_;
        const double slope3 = slope3_;
        const double slope4 = slope4_;
        const double slope5 = slope5_;
        const double decrement = decrement_;
        const double holding = holding_;
        const doubles6s6_t doubles6s6 = {{{{curvature, curvature1, curvature2, curvature3, curvature4,
            curvature5}}, {{curvature6, curvature7, curvature8, curvature9, curvature10, curvature11}},
            {{curvature12, curvature13, curvature14, curvature15, curvature16, curvature17}}, {{curvature18,
            curvature19, curvature20, curvature21, curvature22, curvature23}}, {{curvature24, curvature25,
            curvature26, curvature27, curvature28, curvature29}}, {{curvature30, curvature31, curvature32,
            curvature33, curvature34, curvature35}}}};
        const doubles6s6_t onward = transposed(product1(doubles6s6, motion_result.rows));
        const doubles6s3_t pushed = transposed1(product2(doubles6s6, motion_result.rows1));
        const vectors6_t cross_2 = transposed2((doubles6s3_t){{apply1(onward, pushes.e[0]),
            apply1(onward, pushes.e[1]), apply1(onward, pushes.e[2])}});
        const doubles6_t m_2 = curvature_1(weight.r, pushes, pushed);
        numbers[STIFFNESS_AT + 9 - back] = m_2.e[0] + m_2.e[3] + m_2.e[5];
        const double t16 = numbers[PLAN_AT + 3 * (9 - back)];
        const double t19 = numbers[PLAN_AT + 3 * (9 - back) + 1];
        const double t22 = numbers[PLAN_AT + 3 * (9 - back) + 2];
        const double t24 = numbers[GRADIENT_AT + 3 * (9 - back)];
        const double t26 = numbers[GRADIENT_AT + 3 * (9 - back) + 1];
        const double t28 = numbers[GRADIENT_AT + 3 * (9 - back) + 2];
        const doubles6_t doubles6 = {{slope, slope1, slope2, slope3, slope4, slope5}};
        const vector_t pull = {t24, t26, t28};
        const vector_t g_2 = add(apply2(pushes, doubles6), pull);
        double m_ = m_2.e[0];
        double m1_ = m_2.e[1];
        double m2_ = m_2.e[2];
        double m3_ = m_2.e[3];
        double m4_ = m_2.e[4];
        double m5_ = m_2.e[5];
        double g_ = g_2.x;
        double g1_ = g_2.y;
        double g2_ = g_2.z;
        if (!holds) {
            const vector_t vector = {numbers[MULTIPLIERS_AT + 3 * (9 - back)],
                numbers[MULTIPLIERS_AT + 3 * (9 - back) + 1], numbers[MULTIPLIERS_AT + 3 * (9 - back) + 2]};
            const repelled_result_t repelled_result = repelled(&bounds, (vector_t){t16, t19, t22}, vector,
                barrier, (doubles6_t){{m_2.e[0], m_2.e[1], m_2.e[2], m_2.e[3], m_2.e[4], m_2.e[5]}});
            const vector_t add_result = add((vector_t){g_2.x, g_2.y, g_2.z}, repelled_result.push);
            m_ = repelled_result.symmetric.e[0];
            m1_ = repelled_result.symmetric.e[1];
            m2_ = repelled_result.symmetric.e[2];
            m3_ = repelled_result.symmetric.e[3];
            m4_ = repelled_result.symmetric.e[4];
            m5_ = repelled_result.symmetric.e[5];
            g_ = add_result.x;
            g1_ = add_result.y;
            g2_ = add_result.z;
        }
        const vector_t v = {t16, t19, t22};
        const doubles6_t m_3 = {{m_, m1_, m2_, m3_, m4_, m5_}};
        const held_inverse_result_t held_inverse_result = held_inverse(&bounds, v, pull, m_3, holds);
        const vector_t g_3 = {g_, g1_, g2_};
        const vector_t step_2 = minus(held_inverse_result.symmetric, g_3);
        const vector_t minus_result = minus(held_inverse_result.symmetric, cross_2.e[0]);
        const vector_t minus_result_2 = minus(held_inverse_result.symmetric, cross_2.e[1]);
        const vector_t minus_result_3 = minus(held_inverse_result.symmetric, cross_2.e[2]);
        const vector_t minus_result_4 = minus(held_inverse_result.symmetric, cross_2.e[3]);
        const vector_t minus_result_5 = minus(held_inverse_result.symmetric, cross_2.e[4]);
        const vector_t minus_result_6 = minus(held_inverse_result.symmetric, cross_2.e[5]);
        numbers[STEP_AT + 3 * (9 - back)] = step_2.x;
        numbers[STEP_AT + 3 * (9 - back) + 1] = step_2.y;
        numbers[STEP_AT + 3 * (9 - back) + 2] = step_2.z;
        const vectors6_t gains = {{minus_result, minus_result_2, minus_result_3, minus_result_4,
            minus_result_5, minus_result_6}};
        const doubles6s3_t transposed1_result = transposed1(gains);
        numbers[FEEDBACK_AT + 18 * (9 - back)] = transposed1_result.e[0].e[0];
        numbers[FEEDBACK_AT + 18 * (9 - back) + 1] = transposed1_result.e[0].e[1];
        numbers[FEEDBACK_AT + 18 * (9 - back) + 2] = transposed1_result.e[0].e[2];
        numbers[FEEDBACK_AT + 18 * (9 - back) + 3] = transposed1_result.e[0].e[3];
        numbers[FEEDBACK_AT + 18 * (9 - back) + 4] = transposed1_result.e[0].e[4];
        numbers[FEEDBACK_AT + 18 * (9 - back) + 5] = transposed1_result.e[0].e[5];
        numbers[FEEDBACK_AT + 18 * (9 - back) + 6] = transposed1_result.e[1].e[0];
        numbers[FEEDBACK_AT + 18 * (9 - back) + 7] = transposed1_result.e[1].e[1];
        numbers[FEEDBACK_AT + 18 * (9 - back) + 8] = transposed1_result.e[1].e[2];
        numbers[FEEDBACK_AT + 18 * (9 - back) + 9] = transposed1_result.e[1].e[3];
        numbers[FEEDBACK_AT + 18 * (9 - back) + 10] = transposed1_result.e[1].e[4];
        numbers[FEEDBACK_AT + 18 * (9 - back) + 11] = transposed1_result.e[1].e[5];
        numbers[FEEDBACK_AT + 18 * (9 - back) + 12] = transposed1_result.e[2].e[0];
        numbers[FEEDBACK_AT + 18 * (9 - back) + 13] = transposed1_result.e[2].e[1];
        numbers[FEEDBACK_AT + 18 * (9 - back) + 14] = transposed1_result.e[2].e[2];
        numbers[FEEDBACK_AT + 18 * (9 - back) + 15] = transposed1_result.e[2].e[3];
        numbers[FEEDBACK_AT + 18 * (9 - back) + 16] = transposed1_result.e[2].e[4];
        numbers[FEEDBACK_AT + 18 * (9 - back) + 17] = transposed1_result.e[2].e[5];
        const doubles6s6_t curvature_2 = {{{{dot3(columns.e[0], onward.e[0],
            dot4(cross_2.e[0], minus_result, entry3(weight.q))), dot3(columns.e[0], onward.e[1],
            dot4(cross_2.e[0], minus_result_2, 0.0)), dot3(columns.e[0], onward.e[2],
            dot4(cross_2.e[0], minus_result_3, 0.0)), dot3(columns.e[0], onward.e[3],
            dot4(cross_2.e[0], minus_result_4, 0.0)), dot3(columns.e[0], onward.e[4],
            dot4(cross_2.e[0], minus_result_5, 0.0)), dot3(columns.e[0], onward.e[5],
            dot4(cross_2.e[0], minus_result_6, 0.0))}}, {{dot3(columns.e[1], onward.e[0],
            dot4(cross_2.e[1], minus_result, 0.0)), dot3(columns.e[1], onward.e[1],
            dot4(cross_2.e[1], minus_result_2, entry4(weight.q))), dot3(columns.e[1], onward.e[2],
            dot4(cross_2.e[1], minus_result_3, 0.0)), dot3(columns.e[1], onward.e[3],
            dot4(cross_2.e[1], minus_result_4, 0.0)), dot3(columns.e[1], onward.e[4],
            dot4(cross_2.e[1], minus_result_5, 0.0)), dot3(columns.e[1], onward.e[5],
            dot4(cross_2.e[1], minus_result_6, 0.0))}}, {{dot3(columns.e[2], onward.e[0],
            dot4(cross_2.e[2], minus_result, 0.0)), dot3(columns.e[2], onward.e[1],
            dot4(cross_2.e[2], minus_result_2, 0.0)), dot3(columns.e[2], onward.e[2],
            dot4(cross_2.e[2], minus_result_3, entry5(weight.q))), dot3(columns.e[2], onward.e[3],
            dot4(cross_2.e[2], minus_result_4, 0.0)), dot3(columns.e[2], onward.e[4],
            dot4(cross_2.e[2], minus_result_5, 0.0)), dot3(columns.e[2], onward.e[5],
            dot4(cross_2.e[2], minus_result_6, 0.0))}}, {{dot3(columns.e[3], onward.e[0],
            dot4(cross_2.e[3], minus_result, 0.0)), dot3(columns.e[3], onward.e[1],
            dot4(cross_2.e[3], minus_result_2, 0.0)), dot3(columns.e[3], onward.e[2],
            dot4(cross_2.e[3], minus_result_3, 0.0)), dot3(columns.e[3], onward.e[3],
            dot4(cross_2.e[3], minus_result_4, entry6(weight.q))), dot3(columns.e[3], onward.e[4],
            dot4(cross_2.e[3], minus_result_5, 0.0)), dot3(columns.e[3], onward.e[5],
            dot4(cross_2.e[3], minus_result_6, 0.0))}}, {{dot3(columns.e[4], onward.e[0],
            dot4(cross_2.e[4], minus_result, 0.0)), dot3(columns.e[4], onward.e[1],
            dot4(cross_2.e[4], minus_result_2, 0.0)), dot3(columns.e[4], onward.e[2],
            dot4(cross_2.e[4], minus_result_3, 0.0)), dot3(columns.e[4], onward.e[3],
            dot4(cross_2.e[4], minus_result_4, 0.0)), dot3(columns.e[4], onward.e[4],
            dot4(cross_2.e[4], minus_result_5, entry7(weight.q))), dot3(columns.e[4], onward.e[5],
            dot4(cross_2.e[4], minus_result_6, 0.0))}}, {{dot3(columns.e[5], onward.e[0],
            dot4(cross_2.e[5], minus_result, 0.0)), dot3(columns.e[5], onward.e[1],
            dot4(cross_2.e[5], minus_result_2, 0.0)), dot3(columns.e[5], onward.e[2],
            dot4(cross_2.e[5], minus_result_3, 0.0)), dot3(columns.e[5], onward.e[3],
            dot4(cross_2.e[5], minus_result_4, 0.0)), dot3(columns.e[5], onward.e[4],
            dot4(cross_2.e[5], minus_result_5, 0.0)), dot3(columns.e[5], onward.e[5],
            dot4(cross_2.e[5], minus_result_6, entry8(weight.q)))}}}};
        const doubles6s6_t symmetric_result = symmetric(curvature_2);
        curvature_ = symmetric_result.e[0].e[0];
        curvature1_ = symmetric_result.e[0].e[1];
        curvature2_ = symmetric_result.e[0].e[2];
        curvature3_ = symmetric_result.e[0].e[3];
        curvature4_ = symmetric_result.e[0].e[4];
        curvature5_ = symmetric_result.e[0].e[5];
        curvature6_ = symmetric_result.e[1].e[0];
        curvature7_ = symmetric_result.e[1].e[1];
        curvature8_ = symmetric_result.e[1].e[2];
        curvature9_ = symmetric_result.e[1].e[3];
        curvature10_ = symmetric_result.e[1].e[4];
        curvature11_ = symmetric_result.e[1].e[5];
        curvature12_ = symmetric_result.e[2].e[0];
        curvature13_ = symmetric_result.e[2].e[1];
        curvature14_ = symmetric_result.e[2].e[2];
        curvature15_ = symmetric_result.e[2].e[3];
        curvature16_ = symmetric_result.e[2].e[4];
        curvature17_ = symmetric_result.e[2].e[5];
        curvature18_ = symmetric_result.e[3].e[0];
        curvature19_ = symmetric_result.e[3].e[1];
        curvature20_ = symmetric_result.e[3].e[2];
        curvature21_ = symmetric_result.e[3].e[3];
        curvature22_ = symmetric_result.e[3].e[4];
        curvature23_ = symmetric_result.e[3].e[5];
        curvature24_ = symmetric_result.e[4].e[0];
        curvature25_ = symmetric_result.e[4].e[1];
        curvature26_ = symmetric_result.e[4].e[2];
        curvature27_ = symmetric_result.e[4].e[3];
        curvature28_ = symmetric_result.e[4].e[4];
        curvature29_ = symmetric_result.e[4].e[5];
        curvature30_ = symmetric_result.e[5].e[0];
        curvature31_ = symmetric_result.e[5].e[1];
        curvature32_ = symmetric_result.e[5].e[2];
        curvature33_ = symmetric_result.e[5].e[3];
        curvature34_ = symmetric_result.e[5].e[4];
        curvature35_ = symmetric_result.e[5].e[5];
        slope_ = dot3(columns.e[0], doubles6, dot(cross_2.e[0], step_2));
        slope1_ = dot3(columns.e[1], doubles6, dot(cross_2.e[1], step_2));
        slope2_ = dot3(columns.e[2], doubles6, dot(cross_2.e[2], step_2));
        slope3_ = dot3(columns.e[3], doubles6, dot(cross_2.e[3], step_2));
        slope4_ = dot3(columns.e[4], doubles6, dot(cross_2.e[4], step_2));
        slope5_ = dot3(columns.e[5], doubles6, dot(cross_2.e[5], step_2));
        decrement_ = decrement - dot(step_2, g_3);
        holding_ = holding + held_inverse_result.scalar;
    }
    return (sweep_result_t){.scalar = decrement_, .scalar1 = holding_};
}

/* Return A x + B v. */
static doubles6_t transition(doubles6s6_t a, vectors6_t b, doubles6_t x, vector_t v)
{
    return (doubles6_t){{dot3(a.e[0], x, dot(b.e[0], v)), dot3(a.e[1], x, dot(b.e[1], v)),
        dot3(a.e[2], x, dot(b.e[2], v)), dot3(a.e[3], x, dot(b.e[3], v)), dot3(a.e[4], x, dot(b.e[4], v)),
        dot3(a.e[5], x, dot(b.e[5], v))}};
}

/* -------------------------------- laws.predictive.sixes --------------------------------- */

/* Return x'm x. */
static double form(vector_t m, vector_t x)
{
    const double total = 0.0 + m.x * x.x * x.x + m.y * x.y * x.y + m.z * x.z * x.z;
    return total;
}

/* Return x'm x. */
static double form1(doubles6_t m, doubles6_t x)
{
    const double t12 = 0.0 + m.e[0] * x.e[0] * x.e[0] + m.e[1] * x.e[1] * x.e[1] + m.e[2] * x.e[2] * x.e[2];
    const double total = t12 + m.e[3] * x.e[3] * x.e[3] + m.e[4] * x.e[4] * x.e[4] + m.e[5] * x.e[5] * x.e[5];
    return total;
}

/* Return x'm x. */
static double form2(doubles6s6_t m, doubles6_t x)
{
    return dot2(apply1(m, x), x);
}

/* ------------------------------- laws.predictive.horizon -------------------------------- */

/* Simulate the policy of a sweep with the limits. */
static trial_t follow(double *numbers, doubles6_t start)
{
    const motion_result_t motion_result = motion(numbers);
    const weights_t weight = weights(numbers);
    const limits_t bounds = limits_1(numbers);
    bool cut_ = 0;
    double slope_ = 0.0;
    double change_ = 0.0;
    double x_ = start.e[0];
    double x1_ = start.e[1];
    double x2_ = start.e[2];
    double x3_ = start.e[3];
    double x4_ = start.e[4];
    double x5_ = start.e[5];
    for (int32_t k = 0; k < 10; k++) {
        const bool cut = cut_;
        const double slope = slope_;
        const double change = change_;
        const double x = x_;
        const double x1 = x1_;
        const double x2 = x2_;
        const double x3 = x3_;
        const double x4 = x4_;
        const double x5 = x5_;
        const vector_t v = {numbers[PLAN_AT + 3 * k], numbers[PLAN_AT + 3 * k + 1],
            numbers[PLAN_AT + 3 * k + 2]};
        const vector_t vector = {numbers[STEP_AT + 3 * k], numbers[STEP_AT + 3 * k + 1],
            numbers[STEP_AT + 3 * k + 2]};
        const vector_t add_result = add(v, vector);
        const doubles6_t doubles6 = {{numbers[FEEDBACK_AT + 6 * (3 * k)],
            numbers[FEEDBACK_AT + 6 * (3 * k) + 1], numbers[FEEDBACK_AT + 6 * (3 * k) + 2],
            numbers[FEEDBACK_AT + 6 * (3 * k) + 3], numbers[FEEDBACK_AT + 6 * (3 * k) + 4],
            numbers[FEEDBACK_AT + 6 * (3 * k) + 5]}};
        const doubles6_t x_2 = {{x, x1, x2, x3, x4, x5}};
        const doubles6_t doubles6_2 = {{numbers[FEEDBACK_AT + 6 * (3 * k + 1)],
            numbers[FEEDBACK_AT + 6 * (3 * k + 1) + 1], numbers[FEEDBACK_AT + 6 * (3 * k + 1) + 2],
            numbers[FEEDBACK_AT + 6 * (3 * k + 1) + 3], numbers[FEEDBACK_AT + 6 * (3 * k + 1) + 4],
            numbers[FEEDBACK_AT + 6 * (3 * k + 1) + 5]}};
        const doubles6_t doubles6_3 = {{numbers[FEEDBACK_AT + 6 * (3 * k + 2)],
            numbers[FEEDBACK_AT + 6 * (3 * k + 2) + 1], numbers[FEEDBACK_AT + 6 * (3 * k + 2) + 2],
            numbers[FEEDBACK_AT + 6 * (3 * k + 2) + 3], numbers[FEEDBACK_AT + 6 * (3 * k + 2) + 4],
            numbers[FEEDBACK_AT + 6 * (3 * k + 2) + 5]}};
        const project_result_t project_result = project(&bounds, (vector_t){dot3(doubles6, x_2, add_result.x),
            dot3(doubles6_2, x_2, add_result.y), dot3(doubles6_3, x_2, add_result.z)});
        const vector_t d = subtract(project_result.vector, v);
        const doubles6_t after = transition(motion_result.rows, motion_result.rows1, x_2, d);
        numbers[TRIAL_AT + 3 * k] = project_result.vector.x;
        numbers[TRIAL_AT + 3 * k + 1] = project_result.vector.y;
        numbers[TRIAL_AT + 3 * k + 2] = project_result.vector.z;
        numbers[BEND_AT + 6 * k] = after.e[0];
        numbers[BEND_AT + 6 * k + 1] = after.e[1];
        numbers[BEND_AT + 6 * k + 2] = after.e[2];
        numbers[BEND_AT + 6 * k + 3] = after.e[3];
        numbers[BEND_AT + 6 * k + 4] = after.e[4];
        numbers[BEND_AT + 6 * k + 5] = after.e[5];
        const vector_t vector_2 = {numbers[GRADIENT_AT + 3 * k], numbers[GRADIENT_AT + 3 * k + 1],
            numbers[GRADIENT_AT + 3 * k + 2]};
        const double slope_2 = slope + dot(vector_2, d);
        const double curvature = change + (form(weight.r, d) + form1(weight.q, x_2));
        cut_ = cut || project_result.truth;
        slope_ = slope_2;
        change_ = curvature;
        x_ = after.e[0];
        x1_ = after.e[1];
        x2_ = after.e[2];
        x3_ = after.e[3];
        x4_ = after.e[4];
        x5_ = after.e[5];
    }
    const doubles6_t x_3 = {{x_, x1_, x2_, x3_, x4_, x5_}};
    return (trial_t){.cut = cut_, .change = slope_ + 0.5 * (change_ + form2(weight.p, x_3))};
}

/* -------------------------------- laws.predictive.solver -------------------------------- */

/* Simulate the unlimited policy with the limits; if they cut no move, it is the optimum. */
static bool fly_freely(double *numbers)
{
    for (int32_t k = 0; k < 10; k++) {
        numbers[PLAN_AT + 3 * k] = 0.0;
        numbers[PLAN_AT + 3 * k + 1] = 0.0;
        numbers[PLAN_AT + 3 * k + 2] = 0.0;
        numbers[GRADIENT_AT + 3 * k] = 0.0;
        numbers[GRADIENT_AT + 3 * k + 1] = 0.0;
        numbers[GRADIENT_AT + 3 * k + 2] = 0.0;
    }
    sweep(numbers, 0.0);
    const doubles6_t doubles6 = {{numbers[STATES_AT], numbers[STATES_AT + 1], numbers[STATES_AT + 2],
        numbers[STATES_AT + 3], numbers[STATES_AT + 4], numbers[STATES_AT + 5]}};
    const trial_t trial = follow(numbers, doubles6);
    for (int32_t k1 = 0; k1 < 10; k1++) {
        const double t19 = numbers[TRIAL_AT + 3 * k1];
        const double t22 = numbers[TRIAL_AT + 3 * k1 + 1];
        const double t25 = numbers[TRIAL_AT + 3 * k1 + 2];
        numbers[PLAN_AT + 3 * k1] = t19;
        numbers[PLAN_AT + 3 * k1 + 1] = t22;
        numbers[PLAN_AT + 3 * k1 + 2] = t25;
    }
    return trial.cut;
}

/* ------------------------------- laws.predictive.horizon -------------------------------- */

/* Compute the states under the plan; return half its cost. */
static double rollout(double *numbers)
{
    const motion_result_t motion_result = motion(numbers);
    const weights_t weight = weights(numbers);
    const double t1 = numbers[STATES_AT];
    const double t2 = numbers[STATES_AT + 1];
    const double t3 = numbers[STATES_AT + 2];
    const double t4 = numbers[STATES_AT + 3];
    const double t5 = numbers[STATES_AT + 4];
    const double t6 = numbers[STATES_AT + 5];
    double cost_ = 0.0;
    double x_ = t1;
    double x1_ = t2;
    double x2_ = t3;
    double x3_ = t4;
    double x4_ = t5;
    double x5_ = t6;
    for (int32_t k = 0; k < 10; k++) {
        const double cost = cost_;
        const double x = x_;
        const double x1 = x1_;
        const double x2 = x2_;
        const double x3 = x3_;
        const double x4 = x4_;
        const double x5 = x5_;
        const doubles6_t x_2 = {{x, x1, x2, x3, x4, x5}};
        const vector_t v = {numbers[PLAN_AT + 3 * k], numbers[PLAN_AT + 3 * k + 1],
            numbers[PLAN_AT + 3 * k + 2]};
        const doubles6_t after = transition(motion_result.rows, motion_result.rows1, x_2, v);
        numbers[STATES_AT + 6 * (k + 1)] = after.e[0];
        numbers[STATES_AT + 6 * (k + 1) + 1] = after.e[1];
        numbers[STATES_AT + 6 * (k + 1) + 2] = after.e[2];
        numbers[STATES_AT + 6 * (k + 1) + 3] = after.e[3];
        numbers[STATES_AT + 6 * (k + 1) + 4] = after.e[4];
        numbers[STATES_AT + 6 * (k + 1) + 5] = after.e[5];
        cost_ = cost + (form1(weight.q, x_2) + form(weight.r, v));
        x_ = after.e[0];
        x1_ = after.e[1];
        x2_ = after.e[2];
        x3_ = after.e[3];
        x4_ = after.e[4];
        x5_ = after.e[5];
    }
    const doubles6_t x_3 = {{x_, x1_, x2_, x3_, x4_, x5_}};
    return 0.5 * (cost_ + form2(weight.p, x_3));
}

/* Return R v. */
static vector_t weighed(vector_t r, vector_t v)
{
    return (vector_t){r.x * v.x, r.y * v.y, r.z * v.z};
}

/* -------------------------------- laws.predictive.limits -------------------------------- */

/* Return the part of the gradient along free directions. */
static vector_t loose(const limits_t *limits, vector_t v, vector_t g)
{
    const bools3_t fixed = pressing(limits, v, g);
    return (vector_t){fixed.e[0] ? 0.0 : g.x, fixed.e[1] ? 0.0 : g.y, fixed.e[2] ? 0.0 : g.z};
}

/* ------------------------------- laws.predictive.horizon -------------------------------- */

/* Return Q x + A'y, added term by term. */
static doubles6_t costate(doubles6_t q, doubles6s6_t columns, doubles6_t x, doubles6_t y)
{
    const double t6 = 0.0 + (entry3(q) * x.e[0] + columns.e[0].e[0] * y.e[0]) + columns.e[0].e[1] * y.e[1];
    const double t12 = t6 + columns.e[0].e[2] * y.e[2] + columns.e[0].e[3] * y.e[3] + columns.e[0].e[4] *
        y.e[4];
    const double t20 = 0.0 + columns.e[1].e[0] * y.e[0] + (entry4(q) * x.e[1] + columns.e[1].e[1] * y.e[1]);
    const double t26 = t20 + columns.e[1].e[2] * y.e[2] + columns.e[1].e[3] * y.e[3] + columns.e[1].e[4] *
        y.e[4];
    const double t36 = 0.0 + columns.e[2].e[0] * y.e[0] + columns.e[2].e[1] * y.e[1] + (entry5(q) * x.e[2] +
        columns.e[2].e[2] * y.e[2]);
    const double t42 = t36 + columns.e[2].e[3] * y.e[3] + columns.e[2].e[4] * y.e[4] + columns.e[2].e[5] *
        y.e[5];
    const double t48 = 0.0 + columns.e[3].e[0] * y.e[0] + columns.e[3].e[1] * y.e[1] + columns.e[3].e[2] *
        y.e[2];
    const double t54 = t48 + (entry6(q) * x.e[3] + columns.e[3].e[3] * y.e[3]) + columns.e[3].e[4] * y.e[4];
    const double t62 = 0.0 + columns.e[4].e[0] * y.e[0] + columns.e[4].e[1] * y.e[1] + columns.e[4].e[2] *
        y.e[2];
    const double t68 = t62 + columns.e[4].e[3] * y.e[3] + (entry7(q) * x.e[4] + columns.e[4].e[4] * y.e[4]);
    const double t76 = 0.0 + columns.e[5].e[0] * y.e[0] + columns.e[5].e[1] * y.e[1] + columns.e[5].e[2] *
        y.e[2];
    const double term = entry8(q) * x.e[5] + columns.e[5].e[5] * y.e[5];
    const double total = t76 + columns.e[5].e[3] * y.e[3] + columns.e[5].e[4] * y.e[4] + term;
    return (doubles6_t){{t12 + columns.e[0].e[5] * y.e[5], t26 + columns.e[1].e[5] * y.e[5], t42,
        t54 + columns.e[3].e[5] * y.e[5], t68 + columns.e[4].e[5] * y.e[5], total}};
}

/* Compute the gradient of half the cost; return a bound on its gap to the optimum, valid if the limits
   that hold moves are the active ones. */
static double adjoint(double *numbers)
{
    const motion_result_t motion_result = motion(numbers);
    const weights_t weight = weights(numbers);
    const limits_t bounds = limits_1(numbers);
    const doubles6s6_t columns = transposed(motion_result.rows);
    const doubles6s3_t pushes = transposed1(motion_result.rows1);
    const doubles6_t doubles6 = {{numbers[STATES_AT + 60], numbers[STATES_AT + 61], numbers[STATES_AT + 62],
        numbers[STATES_AT + 63], numbers[STATES_AT + 64], numbers[STATES_AT + 65]}};
    const doubles6_t apply1_result = apply1(weight.p, doubles6);
    double gap_ = 0.0;
    double y_ = apply1_result.e[0];
    double y1_ = apply1_result.e[1];
    double y2_ = apply1_result.e[2];
    double y3_ = apply1_result.e[3];
    double y4_ = apply1_result.e[4];
    double y5_ = apply1_result.e[5];
    for (int32_t back = 0; back < 10; back++) {
        const double gap = gap_;
        const double y = y_;
        const double y1 = y1_;
        const double y2 = y2_;
        const double y3 = y3_;
        const double y4 = y4_;
        const double y5 = y5_;
        const double t20 = numbers[STATES_AT + 6 * (9 - back)];
        const double t23 = numbers[STATES_AT + 6 * (9 - back) + 1];
        const double t26 = numbers[STATES_AT + 6 * (9 - back) + 2];
        const double t29 = numbers[STATES_AT + 6 * (9 - back) + 3];
        const double t32 = numbers[STATES_AT + 6 * (9 - back) + 4];
        const double t35 = numbers[STATES_AT + 6 * (9 - back) + 5];
        const vector_t v = {numbers[PLAN_AT + 3 * (9 - back)], numbers[PLAN_AT + 3 * (9 - back) + 1],
            numbers[PLAN_AT + 3 * (9 - back) + 2]};
        const vector_t weighed_result = weighed(weight.r, v);
        const doubles6_t y_2 = {{y, y1, y2, y3, y4, y5}};
        const double dot3_result = dot3(pushes.e[0], y_2, weighed_result.x);
        const double dot3_result_2 = dot3(pushes.e[1], y_2, weighed_result.y);
        const double dot3_result_3 = dot3(pushes.e[2], y_2, weighed_result.z);
        numbers[GRADIENT_AT + 3 * (9 - back)] = dot3_result;
        numbers[GRADIENT_AT + 3 * (9 - back) + 1] = dot3_result_2;
        numbers[GRADIENT_AT + 3 * (9 - back) + 2] = dot3_result_3;
        const vector_t g = {dot3_result, dot3_result_2, dot3_result_3};
        const doubles6_t x = {{t20, t23, t26, t29, t32, t35}};
        const doubles6_t costate_result = costate(weight.q, columns, x, y_2);
        gap_ = gap + form(weight.r_inverse, loose(&bounds, v, g));
        y_ = costate_result.e[0];
        y1_ = costate_result.e[1];
        y2_ = costate_result.e[2];
        y3_ = costate_result.e[3];
        y4_ = costate_result.e[4];
        y5_ = costate_result.e[5];
    }
    return 0.5 * gap_;
}

/* Turn the policy into a direction: `step` becomes the Newton step without limits. */
static void unroll(double *numbers)
{
    const motion_result_t motion_result = motion(numbers);
    double x_ = 0.0;
    double x1_ = 0.0;
    double x2_ = 0.0;
    double x3_ = 0.0;
    double x4_ = 0.0;
    double x5_ = 0.0;
    for (int32_t k = 0; k < 10; k++) {
        const double x = x_;
        const double x1 = x1_;
        const double x2 = x2_;
        const double x3 = x3_;
        const double x4 = x4_;
        const double x5 = x5_;
        const double t3 = numbers[STEP_AT + 3 * k];
        const double t6 = numbers[STEP_AT + 3 * k + 1];
        const double t9 = numbers[STEP_AT + 3 * k + 2];
        const doubles6_t doubles6 = {{numbers[FEEDBACK_AT + 6 * (3 * k)],
            numbers[FEEDBACK_AT + 6 * (3 * k) + 1], numbers[FEEDBACK_AT + 6 * (3 * k) + 2],
            numbers[FEEDBACK_AT + 6 * (3 * k) + 3], numbers[FEEDBACK_AT + 6 * (3 * k) + 4],
            numbers[FEEDBACK_AT + 6 * (3 * k) + 5]}};
        const doubles6_t x_2 = {{x, x1, x2, x3, x4, x5}};
        const double dot3_result = dot3(doubles6, x_2, t3);
        const doubles6_t doubles6_2 = {{numbers[FEEDBACK_AT + 6 * (3 * k + 1)],
            numbers[FEEDBACK_AT + 6 * (3 * k + 1) + 1], numbers[FEEDBACK_AT + 6 * (3 * k + 1) + 2],
            numbers[FEEDBACK_AT + 6 * (3 * k + 1) + 3], numbers[FEEDBACK_AT + 6 * (3 * k + 1) + 4],
            numbers[FEEDBACK_AT + 6 * (3 * k + 1) + 5]}};
        const double dot3_result_2 = dot3(doubles6_2, x_2, t6);
        const doubles6_t doubles6_3 = {{numbers[FEEDBACK_AT + 6 * (3 * k + 2)],
            numbers[FEEDBACK_AT + 6 * (3 * k + 2) + 1], numbers[FEEDBACK_AT + 6 * (3 * k + 2) + 2],
            numbers[FEEDBACK_AT + 6 * (3 * k + 2) + 3], numbers[FEEDBACK_AT + 6 * (3 * k + 2) + 4],
            numbers[FEEDBACK_AT + 6 * (3 * k + 2) + 5]}};
        const double dot3_result_3 = dot3(doubles6_3, x_2, t9);
        numbers[STEP_AT + 3 * k] = dot3_result;
        numbers[STEP_AT + 3 * k + 1] = dot3_result_2;
        numbers[STEP_AT + 3 * k + 2] = dot3_result_3;
        const vector_t d = {dot3_result, dot3_result_2, dot3_result_3};
        const doubles6_t transition_result = transition(motion_result.rows, motion_result.rows1, x_2, d);
        x_ = transition_result.e[0];
        x1_ = transition_result.e[1];
        x2_ = transition_result.e[2];
        x3_ = transition_result.e[3];
        x4_ = transition_result.e[4];
        x5_ = transition_result.e[5];
    }
}

/* -------------------------------- laws.predictive.solver -------------------------------- */

/* Search along the projection arc of the step (Armijo), halved at most `halvings` times, until the cost
   decreases enough. */
static double shorten(double *numbers, double halvings)
{
    double length_ = 1.0;
    double change_ = 0.0;
    double left_ = halvings;
    for (int32_t turn = 0; turn < 60; turn++) {
        const double length = length_;
        const double change = change_;
        const double left = left_;
        if (change < 0.0 || left <= 0.0) break;
        const motion_result_t motion_result = motion(numbers);
        const weights_t weight = weights(numbers);
        const limits_t bounds = limits_1(numbers);
        double slope_ = 0.0;
        double change1_ = 0.0;
        double x_ = 0.0;
        double x1_ = 0.0;
        double x2_ = 0.0;
        double x3_ = 0.0;
        double x4_ = 0.0;
        double x5_ = 0.0;
        for (int32_t k = 0; k < 10; k++) {
            const double slope = slope_;
            const double change1 = change1_;
            const double x = x_;
            const double x1 = x1_;
            const double x2 = x2_;
            const double x3 = x3_;
            const double x4 = x4_;
            const double x5 = x5_;
            const double t6 = numbers[PLAN_AT + 3 * k];
            const double t9 = numbers[PLAN_AT + 3 * k + 1];
            const double t12 = numbers[PLAN_AT + 3 * k + 2];
            const vector_t vector = {numbers[STEP_AT + 3 * k], numbers[STEP_AT + 3 * k + 1],
                numbers[STEP_AT + 3 * k + 2]};
            const vector_t v = {t6, t9, t12};
            const project_result_t project_result = project(&bounds, add(v, scale(length, vector)));
            const vector_t d = subtract(project_result.vector, v);
            const doubles6_t x_2 = {{x, x1, x2, x3, x4, x5}};
            const doubles6_t after = transition(motion_result.rows, motion_result.rows1, x_2, d);
            numbers[TRIAL_AT + 3 * k] = project_result.vector.x;
            numbers[TRIAL_AT + 3 * k + 1] = project_result.vector.y;
            numbers[TRIAL_AT + 3 * k + 2] = project_result.vector.z;
            numbers[BEND_AT + 6 * k] = after.e[0];
            numbers[BEND_AT + 6 * k + 1] = after.e[1];
            numbers[BEND_AT + 6 * k + 2] = after.e[2];
            numbers[BEND_AT + 6 * k + 3] = after.e[3];
            numbers[BEND_AT + 6 * k + 4] = after.e[4];
            numbers[BEND_AT + 6 * k + 5] = after.e[5];
            const vector_t vector_2 = {numbers[GRADIENT_AT + 3 * k], numbers[GRADIENT_AT + 3 * k + 1],
                numbers[GRADIENT_AT + 3 * k + 2]};
            const double slope_2 = slope + dot(vector_2, d);
            const double curvature = change1 + (form(weight.r, d) + form1(weight.q, x_2));
            slope_ = slope_2;
            change1_ = curvature;
            x_ = after.e[0];
            x1_ = after.e[1];
            x2_ = after.e[2];
            x3_ = after.e[3];
            x4_ = after.e[4];
            x5_ = after.e[5];
        }
        const doubles6_t x_3 = {{x_, x1_, x2_, x3_, x4_, x5_}};
        const double t51 = slope_ + 0.5 * (change1_ + form2(weight.p, x_3));
        const bool falls = slope_ < 0.0 && t51 <= 0.0001 * slope_;
        length_ = 0.5 * length;
        change_ = falls ? t51 : 0.0;
        left_ = left - 1.0;
    }
    return change_;
}

/* Make a trial plan along the Newton step without limits; return the change of half the cost, zero if
   there is no decrease. */
static double search(double *numbers)
{
    unroll(numbers);
    const double shorten_result = shorten(numbers, 8.0);
    return shorten_result;
}

static bool is_zero(double x)
{
    return x <= 0.0 && 0.0 <= x;
}

/* Make a trial plan along the gradient, with a scale for each move: the projection guarantees descent for
   short steps. */
static double gradient_step(double *numbers)
{
    for (int32_t k = 0; k < 10; k++) {
        const double t2 = numbers[STIFFNESS_AT + k];
        const vector_t vector = {numbers[GRADIENT_AT + 3 * k], numbers[GRADIENT_AT + 3 * k + 1],
            numbers[GRADIENT_AT + 3 * k + 2]};
        const vector_t scale_result = scale(-1.0 / t2, vector);
        numbers[STEP_AT + 3 * k] = scale_result.x;
        numbers[STEP_AT + 3 * k + 1] = scale_result.y;
        numbers[STEP_AT + 3 * k + 2] = scale_result.z;
    }
    const double shorten_result = shorten(numbers, 60.0);
    return shorten_result;
}

/* ------------------------------- laws.predictive.horizon -------------------------------- */

/* Replace the plan by the trial plan. */
static void take_over(double *numbers)
{
    for (int32_t k = 0; k < 10; k++) {
        const double t3 = numbers[TRIAL_AT + 3 * k];
        const double t6 = numbers[TRIAL_AT + 3 * k + 1];
        const double t9 = numbers[TRIAL_AT + 3 * k + 2];
        numbers[PLAN_AT + 3 * k] = t3;
        numbers[PLAN_AT + 3 * k + 1] = t6;
        numbers[PLAN_AT + 3 * k + 2] = t9;
        const doubles6_t doubles6 = {{numbers[STATES_AT + 6 * (k + 1)], numbers[STATES_AT + 6 * (k + 1) + 1],
            numbers[STATES_AT + 6 * (k + 1) + 2], numbers[STATES_AT + 6 * (k + 1) + 3],
            numbers[STATES_AT + 6 * (k + 1) + 4], numbers[STATES_AT + 6 * (k + 1) + 5]}};
        const doubles6_t doubles6_2 = {{numbers[BEND_AT + 6 * k], numbers[BEND_AT + 6 * k + 1],
            numbers[BEND_AT + 6 * k + 2], numbers[BEND_AT + 6 * k + 3], numbers[BEND_AT + 6 * k + 4],
            numbers[BEND_AT + 6 * k + 5]}};
        const doubles6_t plus_result = plus(doubles6, doubles6_2);
        numbers[STATES_AT + 6 * (k + 1)] = plus_result.e[0];
        numbers[STATES_AT + 6 * (k + 1) + 1] = plus_result.e[1];
        numbers[STATES_AT + 6 * (k + 1) + 2] = plus_result.e[2];
        numbers[STATES_AT + 6 * (k + 1) + 3] = plus_result.e[3];
        numbers[STATES_AT + 6 * (k + 1) + 4] = plus_result.e[4];
        numbers[STATES_AT + 6 * (k + 1) + 5] = plus_result.e[5];
    }
}

/* -------------------------------- laws.predictive.solver -------------------------------- */

/* Take the projected Newton step, a search along it, or a gradient step, whichever first reduces the cost. */
static attempt_t newton(double *numbers, const progress_t *now)
{
    const sweep_result_t sweep_result = sweep(numbers, 0.0);
    const double sweeps = now->sweeps + 1.0;
    const trial_t trial = follow(numbers, (doubles6_t){{0.0, 0.0, 0.0, 0.0, 0.0, 0.0}});
    const bool none_held = sweep_result.scalar1 <= 0.0;
    const bool free = !trial.cut;
    const double change_2 = free ? -(0.5 * sweep_result.scalar) : trial.change;
    const bool enough = free || change_2 <= -0.25 * sweep_result.scalar;
    double change_ = change_2;
    if (!enough) {
        const double search_result = search(numbers);
        change_ = search_result;
    }
    const bool failed = !free && is_zero(change_);
    const bool hopeful = 1e-12 * now->half < sweep_result.scalar && sweeps < 50.0;
    const bool rescue = failed && (hopeful && !now->rescued);
    const bool t20 = !rescue;
    double change1_ = change_;
    if (failed && t20) {
        const double gradient_step_result = gradient_step(numbers);
        change1_ = gradient_step_result;
    }
    const bool moves = free || !is_zero(change1_);
    const bool t25 = !moves;
    if (!t25) {
        take_over(numbers);
    }
    const double half = now->half + (moves ? change1_ : 0.0);
    const bool stuck = t25 && t20;
    const bool unshaped = free && none_held;
    const bool exact = free && (none_held || sweep_result.scalar <= 1e-16 * half);
    const bool solved = exact || (stuck && sweep_result.scalar <= 1e-12 * half);
    return (attempt_t){.progress = {.half = half, .sweeps = sweeps, .rescued = now->rescued,
        .over = exact || stuck, .solved = solved, .shaped = !unshaped}, .rescue = rescue};
}

/* ------------------------------- laws.predictive.interior ------------------------------- */

/* Store the plan, and start well inside the limits. */
static void begin(double *numbers, double barrier)
{
    const limits_t bounds = limits_1(numbers);
    for (int32_t k = 0; k < 10; k++) {
        const double t3 = numbers[PLAN_AT + 3 * k];
        const double t6 = numbers[PLAN_AT + 3 * k + 1];
        const double t9 = numbers[PLAN_AT + 3 * k + 2];
        numbers[SPARE_AT + 3 * k] = t3;
        numbers[SPARE_AT + 3 * k + 1] = t6;
        numbers[SPARE_AT + 3 * k + 2] = t9;
        const vector_t v = {t3, t6, t9};
        const vector_t w = add(bounds.centre, scale(0.9, subtract(v, bounds.centre)));
        numbers[PLAN_AT + 3 * k] = w.x;
        numbers[PLAN_AT + 3 * k + 1] = w.y;
        numbers[PLAN_AT + 3 * k + 2] = w.z;
        const vector_t slack_result = slack(&bounds, w);
        numbers[MULTIPLIERS_AT + 3 * k] = barrier / slack_result.x;
        numbers[MULTIPLIERS_AT + 3 * k + 1] = barrier / slack_result.y;
        numbers[MULTIPLIERS_AT + 3 * k + 2] = barrier / slack_result.z;
    }
}

/* Return the share of the step that keeps slacks and multipliers positive; put the multipliers' steps into
   `trial`. */
static double length_1(double *numbers, double barrier)
{
    const limits_t bounds = limits_1(numbers);
    double length_ = 1.0;
    for (int32_t k = 0; k < 10; k++) {
        const double length = length_;
        const double t11 = numbers[STEP_AT + 3 * k];
        const double t13 = numbers[STEP_AT + 3 * k + 1];
        const double t15 = numbers[STEP_AT + 3 * k + 2];
        const vector_t v = {numbers[PLAN_AT + 3 * k], numbers[PLAN_AT + 3 * k + 1],
            numbers[PLAN_AT + 3 * k + 2]};
        const vector_t room = slack(&bounds, v);
        const vector_t away = subtract(v, bounds.centre);
        const vector_t d = {t11, t13, t15};
        const vector_t times_result = times(away, d);
        const vector_t times_result_2 = times(d, d);
        const double t23 = numbers[MULTIPLIERS_AT + 3 * k];
        const double step_2 = barrier / room.x - t23 + t23 / room.x * times_result.x;
        numbers[TRIAL_AT + 3 * k] = step_2;
        const double length_2 = step_2 < 0.0 ? minimum(-0.95 * t23 / step_2, length) : length;
        const double ahead = times_result.x + sqrt(times_result.x * times_result.x + 2.0 * room.x *
            times_result_2.x);
        const double length_3 = 0.0 < ahead ? minimum(1.9 * room.x / ahead, length_2) : length_2;
        const double t45 = numbers[MULTIPLIERS_AT + 3 * k + 1];
        const double step_3 = barrier / room.y - t45 + t45 / room.y * times_result.y;
        numbers[TRIAL_AT + 3 * k + 1] = step_3;
        const double length_4 = step_3 < 0.0 ? minimum(-0.95 * t45 / step_3, length_3) : length_3;
        const double ahead_2 = times_result.y + sqrt(times_result.y * times_result.y + 2.0 * room.y *
            times_result_2.y);
        const double length_5 = 0.0 < ahead_2 ? minimum(1.9 * room.y / ahead_2, length_4) : length_4;
        const double t67 = numbers[MULTIPLIERS_AT + 3 * k + 2];
        const double step_4 = barrier / room.z - t67 + t67 / room.z * times_result.z;
        numbers[TRIAL_AT + 3 * k + 2] = step_4;
        const double length_6 = step_4 < 0.0 ? minimum(-0.95 * t67 / step_4, length_5) : length_5;
        const double ahead_3 = times_result.z + sqrt(times_result.z * times_result.z + 2.0 * room.z *
            times_result_2.z);
        const double shorter = minimum(1.9 * room.z / ahead_3, length_6);
        const double length_7 = 0.0 < ahead_3 ? shorter : length_6;
        length_ = length_7;
    }
    return length_;
}

/* Take that share of the step; return the sum of slack times multiplier. */
static double go(double *numbers, double length)
{
    const limits_t bounds = limits_1(numbers);
    double gap_ = 0.0;
    for (int32_t k = 0; k < 10; k++) {
        const double gap = gap_;
        const double t3 = numbers[PLAN_AT + 3 * k];
        const double t6 = numbers[PLAN_AT + 3 * k + 1];
        const double t9 = numbers[PLAN_AT + 3 * k + 2];
        const vector_t vector = {numbers[STEP_AT + 3 * k], numbers[STEP_AT + 3 * k + 1],
            numbers[STEP_AT + 3 * k + 2]};
        const vector_t w = add((vector_t){t3, t6, t9}, scale(length, vector));
        numbers[PLAN_AT + 3 * k] = w.x;
        numbers[PLAN_AT + 3 * k + 1] = w.y;
        numbers[PLAN_AT + 3 * k + 2] = w.z;
        const vector_t room = slack(&bounds, w);
        const double t19 = numbers[MULTIPLIERS_AT + 3 * k];
        const double t21 = numbers[TRIAL_AT + 3 * k];
        const double multiplier = t19 + length * t21;
        numbers[MULTIPLIERS_AT + 3 * k] = multiplier;
        const double t27 = numbers[MULTIPLIERS_AT + 3 * k + 1];
        const double t29 = numbers[TRIAL_AT + 3 * k + 1];
        const double multiplier_2 = t27 + length * t29;
        numbers[MULTIPLIERS_AT + 3 * k + 1] = multiplier_2;
        const double t35 = numbers[MULTIPLIERS_AT + 3 * k + 2];
        const double t37 = numbers[TRIAL_AT + 3 * k + 2];
        const double multiplier_3 = t35 + length * t37;
        numbers[MULTIPLIERS_AT + 3 * k + 2] = multiplier_3;
        const double gap_2 = gap + multiplier * room.x + multiplier_2 * room.y + multiplier_3 * room.z;
        gap_ = gap_2;
    }
    return gap_;
}

/* Take one step towards the optimum for this barrier, then lower the barrier. */
static turn_t turn_1(double *numbers, const turn_t *now, double count, double most)
{
    adjoint(numbers);
    sweep(numbers, now->barrier);
    unroll(numbers);
    const double length = length_1(numbers, now->barrier);
    const double gap = go(numbers, length);
    const double half = rollout(numbers);
    const double sweeps = now->sweeps + 1.0;
    const bool long_of = 0.5 < length;
    const bool near = gap <= (long_of ? 1e-08 : 1e-05) * half;
    return (turn_t){.barrier = (long_of ? 0.1 : 0.5) * gap / count, .sweeps = sweeps,
        .done = near || most <= sweeps};
}

/* Put moves that are near a limit on it. */
static void settle(double *numbers)
{
    const limits_t bounds = limits_1(numbers);
    const double near = 1e-05 * bounds.bound * bounds.bound;
    for (int32_t k = 0; k < 10; k++) {
        const vector_t v = {numbers[PLAN_AT + 3 * k], numbers[PLAN_AT + 3 * k + 1],
            numbers[PLAN_AT + 3 * k + 2]};
        const vector_t room = slack(&bounds, v);
        const vector_t subtract_result = subtract(v, bounds.centre);
        const vector_t add_result = add(bounds.centre,
            (vector_t){(room.x < near ? 2.0 : 1.0) * subtract_result.x,
            (room.y < near ? 2.0 : 1.0) * subtract_result.y,
            (room.z < near ? 2.0 : 1.0) * subtract_result.z});
        const project_result_t project_result = project(&bounds, add_result);
        numbers[PLAN_AT + 3 * k] = project_result.vector.x;
        numbers[PLAN_AT + 3 * k + 1] = project_result.vector.y;
        numbers[PLAN_AT + 3 * k + 2] = project_result.vector.z;
    }
}

/* Restore the stored plan; return half its cost. */
static double restore(double *numbers)
{
    for (int32_t k = 0; k < 10; k++) {
        const double t3 = numbers[SPARE_AT + 3 * k];
        const double t6 = numbers[SPARE_AT + 3 * k + 1];
        const double t9 = numbers[SPARE_AT + 3 * k + 2];
        numbers[PLAN_AT + 3 * k] = t3;
        numbers[PLAN_AT + 3 * k + 1] = t6;
        numbers[PLAN_AT + 3 * k + 2] = t9;
    }
    const double rollout_result = rollout(numbers);
    return rollout_result;
}

/* Solve by the primal-dual interior-point method (Boyd and Vandenberghe 2004, section 11.7): it approaches
   the optimum in a number of sweeps that hardly depends on the program, and then moves that are near a
   limit are put on it. */
static interior_result_t interior(double *numbers, double half, double most)
{
    const double barrier_2 = 0.1 * half / 30.0;
    begin(numbers, barrier_2);
    rollout(numbers);
    double barrier_ = barrier_2;
    double sweeps_ = 0.0;
    bool done_ = most <= 0.0;
    for (int32_t turn = 0; turn < 30; turn++) {
        const double barrier = barrier_;
        const double sweeps = sweeps_;
        const bool done = done_;
        if (done) break;
        const turn_t now = {.barrier = barrier, .sweeps = sweeps, .done = done};
        const turn_t turn_1_result = turn_1(numbers, &now, 30.0, most);
        barrier_ = turn_1_result.barrier;
        sweeps_ = turn_1_result.sweeps;
        done_ = turn_1_result.done;
    }
    settle(numbers);
    const double reached = rollout(numbers);
    double half1_ = reached;
    if (!(reached <= half)) {
        const double restore_result = restore(numbers);
        half1_ = restore_result;
    }
    return (interior_result_t){.scalar = sweeps_, .scalar1 = half1_};
}

/* -------------------------------- laws.predictive.solver -------------------------------- */

/* Take a Newton step, or use the interior-point method where that fails. */
static progress_t better(double *numbers, const progress_t *now)
{
    const bool slow = 12.0 <= now->sweeps && !now->rescued;
    double half_ = now->half;
    double sweeps_ = now->sweeps;
    bool rescued_ = now->rescued;
    bool over_ = now->over;
    bool solved_ = now->solved;
    bool shaped_ = now->shaped;
    bool rescue_ = slow;
    if (!slow) {
        const attempt_t newton_result = newton(numbers, now);
        half_ = newton_result.progress.half;
        sweeps_ = newton_result.progress.sweeps;
        rescued_ = newton_result.progress.rescued;
        over_ = newton_result.progress.over;
        solved_ = newton_result.progress.solved;
        shaped_ = newton_result.progress.shaped;
        rescue_ = newton_result.rescue;
    }
    double half1_ = half_;
    double sweeps1_ = sweeps_;
    bool rescued1_ = rescued_;
    if (rescue_) {
        const interior_result_t interior_result = interior(numbers, half_, 50.0 - sweeps_);
        half1_ = interior_result.scalar1;
        sweeps1_ = sweeps_ + interior_result.scalar;
        rescued1_ = 1;
    }
    return (progress_t){.half = half1_, .sweeps = sweeps1_, .rescued = rescued1_, .over = over_,
        .solved = solved_, .shaped = shaped_};
}

/* End the run or improve the plan in one turn. */
static progress_t turn1_1(double *numbers, const progress_t *now)
{
    const double adjoint_result = adjoint(numbers);
    const bool optimal = adjoint_result <= 1e-16 * now->half;
    const bool used_up = 50.0 <= now->sweeps;
    double half_ = now->half;
    double sweeps_ = now->sweeps;
    bool rescued_ = now->rescued;
    bool over_ = 1;
    bool solved_ = optimal;
    bool shaped_ = now->shaped;
    if (!(optimal || used_up)) {
        const progress_t better_result = better(numbers, now);
        half_ = better_result.half;
        sweeps_ = better_result.sweeps;
        rescued_ = better_result.rescued;
        over_ = better_result.over;
        solved_ = better_result.solved;
        shaped_ = better_result.shaped;
    }
    return (progress_t){.half = half_, .sweeps = sweeps_, .rescued = rescued_, .over = over_,
        .solved = solved_, .shaped = shaped_};
}

/* ------------------------------------ algebra.scalar ------------------------------------ */

/* Tell whether x is neither infinite nor NaN. */
static bool is_finite(double x)
{
    return absolute(x - x) < 1.0;
}

/* -------------------------------- laws.predictive.solver -------------------------------- */

/* Improve the plan until it is optimal or the sweeps are used up. */
static solved_t descend(double *numbers, double sweeps)
{
    const double rollout_result = rollout(numbers);
    double half_ = rollout_result;
    double sweeps1_ = sweeps;
    bool rescued_ = 0;
    bool over_ = 0;
    bool solved_ = 0;
    bool shaped_ = 1;
    for (int32_t turn = 0; turn < 51; turn++) {
        const double half = half_;
        const double sweeps_2 = sweeps1_;
        const bool rescued = rescued_;
        const bool over = over_;
        const bool solved = solved_;
        const bool shaped = shaped_;
        if (over) break;
        const progress_t now = {.half = half, .sweeps = sweeps_2, .rescued = rescued, .over = over,
            .solved = solved, .shaped = shaped};
        const progress_t turn1_1_result = turn1_1(numbers, &now);
        half_ = turn1_1_result.half;
        sweeps1_ = turn1_1_result.sweeps;
        rescued_ = turn1_1_result.rescued;
        over_ = turn1_1_result.over;
        solved_ = turn1_1_result.solved;
        shaped_ = turn1_1_result.shaped;
    }
    return (solved_t){.sweeps = sweeps1_, .solved = solved_, .shaped = shaped_ && is_finite(half_)};
}

/* Solve the program from its first state, starting from its plan if `warm`; the plan is overwritten. */
static solved_t improve(double *numbers, bool warm)
{
    double sweeps_ = 0.0;
    bool cut_ = 1;
    if (!warm) {
        const bool fly_freely_result = fly_freely(numbers);
        sweeps_ = 1.0;
        cut_ = fly_freely_result;
    }
    double sweeps1_ = sweeps_;
    bool solved_ = 1;
    bool shaped_ = 0;
    if (cut_) {
        const solved_t descend_result = descend(numbers, sweeps_);
        sweeps1_ = descend_result.sweeps;
        solved_ = descend_result.solved;
        shaped_ = descend_result.shaped;
    }
    return (solved_t){.sweeps = sweeps1_, .solved = solved_, .shaped = shaped_};
}

/* --------------------------------------- laws.mpc --------------------------------------- */

/* Bring the counters up to date. */
static void count_1(double *numbers, const solved_t *end)
{
    const double t1 = numbers[COUNTERS_AT];
    const double t2 = numbers[COUNTERS_AT + 1];
    const double t3 = numbers[COUNTERS_AT + 2];
    const double t4 = numbers[COUNTERS_AT + 3];
    numbers[COUNTERS_AT] = t1 + 1.0;
    numbers[COUNTERS_AT + 1] = t2 + end->sweeps;
    numbers[COUNTERS_AT + 2] = maximum(t3, end->sweeps);
    numbers[COUNTERS_AT + 3] = t4 + (end->solved ? 0.0 : 1.0);
    numbers[COUNTERS_AT + 4] = end->shaped ? 1.0 : 0.0;
}

/* -------------------------------- laws.predictive.sixes --------------------------------- */

/* Return the k-th group of three numbers of a buffer. */
static vector_t triple1(double *numbers)
{
    const vector_t vector = {numbers[PLAN_AT], numbers[PLAN_AT + 1], numbers[PLAN_AT + 2]};
    return vector;
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

/* --------------------------------------- laws.mpc --------------------------------------- */

/* Return the control torque (N m, body axes), the first move of the optimal plan. */
static vector_t mpc_torque(double *numbers, const measurement_t *measurement, const craft_t *craft)
{
    const vector_t ahead = tracking_torque(measurement, craft);
    const linear_t linear = linearise(measurement, craft);
    sample(numbers, &linear, measurement->period);
    put_limits(numbers, scale(-1.0, ahead), craft->torque_limit);
    const double t1 = numbers[COUNTERS_AT + 4];
    const bool warm = 0.0 < t1;
    if (warm) {
        advance(numbers);
    }
    const vector_t vector_part_result = vector_part(measurement->attitude);
    numbers[STATES_AT] = vector_part_result.x;
    numbers[STATES_AT + 1] = vector_part_result.y;
    numbers[STATES_AT + 2] = vector_part_result.z;
    numbers[STATES_AT + 3] = measurement->rate.x;
    numbers[STATES_AT + 4] = measurement->rate.y;
    numbers[STATES_AT + 5] = measurement->rate.z;
    const solved_t end = improve(numbers, warm);
    count_1(numbers, &end);
    const vector_t triple1_result = triple1(numbers);
    const vector_t command_2 = add(triple1_result, ahead);
    return clip_axes(command_2, craft->torque_limit);
}

/* -------------------------------- parts.actuators.limits -------------------------------- */

/* Saturate each component at +-limit, as wheels or thruster pairs along the axes do. */
static vector_t limit_axis(vector_t command, double limit)
{
    return clip_axes(command, limit);
}

/* -------------------------------------- interface --------------------------------------- */

/* What numbers begin with; the rest are zeros. */
static const double first_numbers[71] = {
    0.0, 0.0, 0.0, 0.0, 0.0, 0.2, 0.2, 0.2, 0.2, 0.2, 0.2, 50.0, 50.0, 50.0, 0.02, 0.02, 0.02,
    22.946773472133042, 0.0, 0.0, 63.245632260866046, 0.0, 0.0, 0.0, 27.938050579455364, 0.0, 0.0,
    94.86838250802516, 0.0, 0.0, 0.0, 32.16149041269614, 0.0, 0.0, 126.49114593545856, 63.245632260866046,
    0.0, 0.0, 361.33965833959996, 0.0, 0.0, 0.0, 94.86838250802516, 0.0, 0.0, 660.337707668138, 0.0, 0.0, 0.0,
    126.49114593545856, 0.0, 0.0, 1013.9736656741607, 0.06267696292404693, 0.0, 0.0, 0.3595585175330206, 0.0,
    0.0, 0.0, 0.06278328749571621, 0.0, 0.0, 0.4385106654037334, 0.0, 0.0, 0.0, 0.06284605433756812, 0.0, 0.0,
    0.5053056935128754
};

void mpc_init(mpc_state_t *state)
{
    for (int32_t k = 0; k < 697; k++) {
        state->numbers[k] = k < 71 ? first_numbers[k] : 0.0;
    }
}

void mpc_step(mpc_state_t *state, const mpc_input_t *input, mpc_command_t *command)
{
    double *const numbers = state->numbers;
    const state_t known = {.attitude = input->attitude, .rate = input->rate, .position = input->position};
    const scene_t scene = {.goal = inertial_goal(&parameters.setup.target),
        .period = parameters.setup.period};
    const measurement_t measurement = observe(&known, &scene);
    const vector_t mpc_torque_result = mpc_torque(numbers, &measurement, &parameters.craft);
    const vector_t wanted = limit_axis(mpc_torque_result, parameters.setup.limit);
    command->torque = wanted;
}
