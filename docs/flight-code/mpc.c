/* mpc.c: made by starhold 0.1.0; see mpc.h. Do not edit: change the scenario and export it again. */

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

/* Which attitude. */
typedef struct {
    quaternion_t attitude; /* unit quaternion, scalar first */
} inertial_params_t;

/* The attitude to be reached: q_RN (inertial to target axes), and the target's angular velocity (rad/s)
   and acceleration (rad/s2), both in target axes. */
typedef struct {
    quaternion_t attitude;
} goal_t;

/* A rigid spacecraft. */
typedef struct {
    vector_t inertia; /* kg m^2: of a craft with wheels without their rotors' about their axes */
    vector_t inverse_inertia; /* 1/(kg m^2): its inverse */
    /* N m: that a law may reckon with, per axis or in norm; infinite for none; with wheels at most what they
       give */
    double torque_limit;
    double gravity; /* m^3/s^2: gravitational parameter of the body that it orbits */
} craft_t;

/* Attitude q_BN (inertial to body), rate omega_BN_B (rad/s), position and velocity (inertial; m, m/s), and
   the torque the actuators give (body, N m), which has dynamics of its own when the actuators lag. */
typedef struct {
    quaternion_t attitude;
    vector_t rate;
    vector_t position;
} state_t;

/* Beside the state all that a measurement is made of: the goal (None where the loop has no target),
   whether it never turns, the modelled torque from outside (N m, body), the effectors' momentum (N m s,
   body), the control period, the limit of the command, and all readings of the sensors, an attribute for
   each. */
typedef struct {
    goal_t goal;
    double period;
} scene_t;

/* Quantities that a law is told at a control instant; vectors are in body axes. */
typedef struct {
    quaternion_t attitude; /* rotation from the target axes to the body axes, scalar first */
    vector_t rate; /* rad/s: angular velocity relative to the target */
    vector_t body_rate; /* rad/s: absolute angular velocity */
    vector_t target_acceleration; /* rad/s^2: derivative of target_rate as the turning body sees it */
    vector_t position; /* m: from the centre of attraction */
    double period; /* s: for which the torque will be held */
} measurement_t;

/* What as_published gives. */
typedef struct {
    quaternion_t attitude;
} as_published_result_t;

/* Rows of a 3x3 matrix. */
typedef struct {
    vector_t row[3];
} matrix_t;

/* The motion is x' = A x + B u for x = (q; w), small about the measured motion, in blocks of three: A =
   [[turning, E/2], [stiffness, damping]], B = [0; push]. */
typedef struct {
    matrix_t turning;
    matrix_t stiffness;
    matrix_t damping;
    matrix_t push;
} linear_t;

/* The blocks are those of A of `Linear` over some time: [[turning, half E], [stiffness, damping]]. */
typedef struct {
    matrix_t turning;
    double half;
    matrix_t stiffness;
    matrix_t damping;
} rates_t;

/* Six numbers. */
typedef struct {
    double e[6];
} six_t;

typedef struct {
    six_t e[6];
} six_rows_t;

/* What share gives. */
typedef struct {
    double share;
    double count;
} share_result_t;

/* A move v keeps |v - centre| <= bound (N m; inf: none), in norm (ball) or on each axis, which is low <= v
   <= high. */
typedef struct {
    vector_t centre;
    double bound;
    vector_t low;
    vector_t high;
} limits_t;

/* What project gives. */
typedef struct {
    vector_t w;
    bool truth;
} project_result_t;

typedef struct {
    vector_t e[6];
} six_vectors_t;

/* What motion gives. */
typedef struct {
    six_rows_t rows;
    six_vectors_t rows1;
} motion_result_t;

/* The weights are Q and R, full or as their diagonals, the inverse of R, and P. */
typedef struct {
    six_t q;
    vector_t r;
    vector_t r_inverse;
    six_rows_t p;
} weights_t;

typedef struct {
    six_t e[3];
} sixs3_t;

/* What repelled gives. */
typedef struct {
    six_t symmetric;
    vector_t push;
} repelled_result_t;

typedef struct {
    bool e[3];
} bools3_t;

/* What held_inverse gives. */
typedef struct {
    six_t symmetric;
    double scalar;
} held_inverse_result_t;

/* What sweep gives. */
typedef struct {
    double scalar;
    double scalar1;
} sweep_result_t;

/* A trial plan tells whether a limit cut anything, and half the cost towards it, which changes by slope +
   curvature / 2, free of the cancellation that a difference of two costs suffers. */
typedef struct {
    bool cut;
    double change;
} trial_t;

/* A run stands at half the cost of the plan, the sweeps so far, whether the interior-point method has been
   used, whether the run is over, and what `Solved` says then. */
typedef struct {
    double half;
    double sweeps;
    bool rescued;
    bool over;
    bool solved;
    bool shaped;
} progress_t;

/* An attempt tells what a Newton step gave, and whether the interior-point method is asked for. */
typedef struct {
    progress_t progress;
    bool rescue;
} attempt_t;

/* The state of the method is the barrier's height, the sweeps so far, and whether the end is reached. */
typedef struct {
    double barrier;
    double sweeps;
    bool done;
} turn_t;

/* What interior gives. */
typedef struct {
    double scalar;
    double kept;
} interior_result_t;

/* A run gives the number of Riccati sweeps, whether the optimum was reached, and whether limits shape it. */
typedef struct {
    double sweeps;
    bool solved;
    bool shaped;
} solved_t;

/* The numbers of a loop that are neither the craft's nor the law's; kernels take them as an argument. */
typedef struct {
    double period;
    double limit;
    inertial_params_t target;
} setup_t;

/* The numbers that do not change in flight. */
typedef struct {
    craft_t craft;
    setup_t setup;
} parameters_t;

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

/* Read 6 numbers that stand together. */
static six_t six_at(const double *numbers)
{
    return (six_t){{numbers[0], numbers[1], numbers[2], numbers[3], numbers[4], numbers[5]}};
}

/* Write 6 numbers that stand together. */
static void put_six(double *numbers, six_t value)
{
    numbers[0] = value.e[0];
    numbers[1] = value.e[1];
    numbers[2] = value.e[2];
    numbers[3] = value.e[3];
    numbers[4] = value.e[4];
    numbers[5] = value.e[5];
}

/* Read 3 numbers that stand together. */
static vector_t vector_at(const double *numbers)
{
    return (vector_t){numbers[0], numbers[1], numbers[2]};
}

/* Write 3 numbers that stand together. */
static void put_vector(double *numbers, vector_t value)
{
    numbers[0] = value.x;
    numbers[1] = value.y;
    numbers[2] = value.z;
}

/* -------------------------------- parts.targets.inertial -------------------------------- */

/* The attitude, at rest. */
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

/* The inertia with all that is in the craft, which gravity acts on (kg m2). */
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

/* The measurement that a law is told of a state as sensors or estimators tell it. */
static measurement_t observe(const state_t *state, const scene_t *scene)
{
    const quaternion_t error = relative(scene->goal.attitude, state->attitude);
    const vector_t position = to_body(state->attitude, state->position);
    return (measurement_t){.attitude = error, .rate = state->rate, .body_rate = state->rate,
        .target_acceleration = {0.0, 0.0, 0.0}, .position = position, .period = scene->period};
}

/* -------------------------------- parts.quaternion_sign --------------------------------- */

/* Feed back q itself: continuous, but the body may turn the long way (unwinding). */
static as_published_result_t as_published(quaternion_t attitude)
{
    return (as_published_result_t){.attitude = attitude};
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

/* Return the matrix-vector product; a vector in place of the matrix is a diagonal one. */
static vector_t apply(vector_t m, vector_t a)
{
    return times(m, a);
}

/* ------------------------------------ laws.interface ------------------------------------ */

/* The torque (N m) that makes the motion relative to a moving target obey the equations of a target at
   rest, J w_e' + w_e x J w_e = rest of the torque; zero for a target at rest. */
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

/* Return the motion near the measurement (SI units). */
static linear_t linearise(const measurement_t *measurement, const craft_t *craft)
{
    const vector_t momentum = apply(craft->inertia, measurement->rate);
    const vector_t pull = apply(total_inertia(craft), measurement->position);
    const double square = dot(measurement->position, measurement->position);
    const double strength = 0.0 < square ? 6.0 * craft->gravity / (square * square * sqrt(square)) : 0.0;
    const vector_t lever = cross(measurement->position, (vector_t){1.0, 0.0, 0.0});
    const vector_t scale_2 = scale(strength, apply(craft->inverse_inertia,
        subtract(cross(measurement->position, apply(total_inertia(craft), lever)), cross(pull, lever))));
    const vector_t lever_2 = cross(measurement->position, (vector_t){0.0, 1.0, 0.0});
    const vector_t scale_3 = scale(strength, apply(craft->inverse_inertia,
        subtract(cross(measurement->position, apply(total_inertia(craft), lever_2)), cross(pull, lever_2))));
    const vector_t lever_3 = cross(measurement->position, (vector_t){0.0, 0.0, 1.0});
    const vector_t tilt = subtract(cross(measurement->position, apply(total_inertia(craft), lever_3)),
        cross(pull, lever_3));
    const vector_t apply_2 = apply(craft->inverse_inertia,
        subtract(cross(momentum, (vector_t){1.0, 0.0, 0.0}), cross(measurement->rate,
        apply(craft->inertia, (vector_t){1.0, 0.0, 0.0}))));
    const vector_t apply_3 = apply(craft->inverse_inertia,
        subtract(cross(momentum, (vector_t){0.0, 1.0, 0.0}), cross(measurement->rate,
        apply(craft->inertia, (vector_t){0.0, 1.0, 0.0}))));
    const vector_t apply_4 = apply(craft->inverse_inertia,
        subtract(cross(momentum, (vector_t){0.0, 0.0, 1.0}), cross(measurement->rate,
        apply(craft->inertia, (vector_t){0.0, 0.0, 1.0}))));
    const matrix_t transpose_2 =
        transpose((matrix_t){{apply(craft->inverse_inertia, (vector_t){1.0, 0.0, 0.0}),
        apply(craft->inverse_inertia, (vector_t){0.0, 1.0, 0.0}),
        apply(craft->inverse_inertia, (vector_t){0.0, 0.0, 1.0})}});
    return (linear_t){.turning = transpose(skew(measurement->rate)), .stiffness =
        transpose((matrix_t){{scale_2, scale_3, scale(strength, apply(craft->inverse_inertia, tilt))}}),
        .damping = transpose((matrix_t){{apply_2, apply_3, apply_4}}), .push = transpose_2};
}

static matrix_t scaled(matrix_t m, double c)
{
    return (matrix_t){{scale(c, m.row[0]), scale(c, m.row[1]), scale(c, m.row[2])}};
}

/* Return the whole matrix. */
static six_rows_t rows(const rates_t *rates)
{
    return (six_rows_t){{{{0.0, rates->turning.row[0].y, rates->turning.row[0].z, rates->half, 0.0, 0.0}},
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

/* Return the share of the period, halved until no row's absolute sum passes 1, and how often that was. */
static share_result_t share_1(const rates_t *rates)
{
    const six_rows_t rows_2 = rows(rates);
    const double t3 = 0.0 + absolute(rows_2.e[0].e[0]) + absolute(rows_2.e[0].e[1]) +
        absolute(rows_2.e[0].e[2]);
    const double t6 = t3 + absolute(rows_2.e[0].e[3]) + absolute(rows_2.e[0].e[4]) +
        absolute(rows_2.e[0].e[5]);
    const double t9 = 0.0 + absolute(rows_2.e[1].e[0]) + absolute(rows_2.e[1].e[1]) +
        absolute(rows_2.e[1].e[2]);
    const double t12 = t9 + absolute(rows_2.e[1].e[3]) + absolute(rows_2.e[1].e[4]) +
        absolute(rows_2.e[1].e[5]);
    const double t15 = 0.0 + absolute(rows_2.e[2].e[0]) + absolute(rows_2.e[2].e[1]) +
        absolute(rows_2.e[2].e[2]);
    const double t18 = t15 + absolute(rows_2.e[2].e[3]) + absolute(rows_2.e[2].e[4]) +
        absolute(rows_2.e[2].e[5]);
    const double t21 = 0.0 + absolute(rows_2.e[3].e[0]) + absolute(rows_2.e[3].e[1]) +
        absolute(rows_2.e[3].e[2]);
    const double t24 = t21 + absolute(rows_2.e[3].e[3]) + absolute(rows_2.e[3].e[4]) +
        absolute(rows_2.e[3].e[5]);
    const double t27 = 0.0 + absolute(rows_2.e[4].e[0]) + absolute(rows_2.e[4].e[1]) +
        absolute(rows_2.e[4].e[2]);
    const double t30 = t27 + absolute(rows_2.e[4].e[3]) + absolute(rows_2.e[4].e[4]) +
        absolute(rows_2.e[4].e[5]);
    const double t33 = 0.0 + absolute(rows_2.e[5].e[0]) + absolute(rows_2.e[5].e[1]) +
        absolute(rows_2.e[5].e[2]);
    const double total = t33 + absolute(rows_2.e[5].e[3]) + absolute(rows_2.e[5].e[4]) +
        absolute(rows_2.e[5].e[5]);
    double size_ = maximum(total, maximum(t30, maximum(t24, maximum(t18, maximum(t12, maximum(t6, 0.0))))));
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
    return (share_result_t){.share = share_, .count = count_};
}

/* The rates act over that share of the time. */
static rates_t during(const rates_t *rates, double share)
{
    return (rates_t){.turning = scaled(rates->turning, share), .half = rates->half * share,
        .stiffness = scaled(rates->stiffness, share), .damping = scaled(rates->damping, share)};
}

/* -------------------------------- laws.predictive.sixes --------------------------------- */

/* Return the transposed matrix. */
static six_rows_t transposed(six_rows_t m)
{
    return (six_rows_t){{{{m.e[0].e[0], m.e[1].e[0], m.e[2].e[0], m.e[3].e[0], m.e[4].e[0], m.e[5].e[0]}},
        {{m.e[0].e[1], m.e[1].e[1], m.e[2].e[1], m.e[3].e[1], m.e[4].e[1], m.e[5].e[1]}}, {{m.e[0].e[2],
        m.e[1].e[2], m.e[2].e[2], m.e[3].e[2], m.e[4].e[2], m.e[5].e[2]}}, {{m.e[0].e[3], m.e[1].e[3],
        m.e[2].e[3], m.e[3].e[3], m.e[4].e[3], m.e[5].e[3]}}, {{m.e[0].e[4], m.e[1].e[4], m.e[2].e[4],
        m.e[3].e[4], m.e[4].e[4], m.e[5].e[4]}}, {{m.e[0].e[5], m.e[1].e[5], m.e[2].e[5], m.e[3].e[5],
        m.e[4].e[5], m.e[5].e[5]}}}};
}

/* -------------------------------- laws.predictive.motion -------------------------------- */

static six_t times1(six_t row, double c)
{
    return (six_t){{row.e[0] * c, row.e[1] * c, row.e[2] * c, row.e[3] * c, row.e[4] * c, row.e[5] * c}};
}

/* -------------------------------- laws.predictive.sixes --------------------------------- */

/* Return start + a'b. */
static double dot1(vector_t a, vector_t b)
{
    const double total = 0.0 + a.x * b.x + a.y * b.y + a.z * b.z;
    return total;
}

/* Return start + a'b. */
static double dot2(six_t a, six_t b)
{
    const double t8 = 0.0 + a.e[0] * b.e[0] + a.e[1] * b.e[1] + a.e[2] * b.e[2] + a.e[3] * b.e[3];
    const double total = t8 + a.e[4] * b.e[4] + a.e[5] * b.e[5];
    return total;
}

/* -------------------------------- laws.predictive.motion -------------------------------- */

/* Return the matrix times a column, without its zeros. */
static six_t product(const rates_t *rates, six_t x)
{
    const six_rows_t rows_2 = rows(rates);
    return (six_t){{dot1((vector_t){rates->turning.row[0].y, rates->turning.row[0].z, rates->half},
        (vector_t){x.e[1], x.e[2], x.e[3]}), dot1((vector_t){rates->turning.row[1].x, rates->turning.row[1].z,
        rates->half}, (vector_t){x.e[0], x.e[2], x.e[4]}), dot1((vector_t){rates->turning.row[2].x,
        rates->turning.row[2].y, rates->half}, (vector_t){x.e[0], x.e[1], x.e[5]}), dot2(rows_2.e[3], x),
        dot2(rows_2.e[4], x), dot2(rows_2.e[5], x)}};
}

/* -------------------------------- laws.predictive.sixes --------------------------------- */

/* Return a + b. */
static six_t plus(six_t a, six_t b)
{
    return (six_t){{a.e[0] + b.e[0], a.e[1] + b.e[1], a.e[2] + b.e[2], a.e[3] + b.e[3], a.e[4] + b.e[4],
        a.e[5] + b.e[5]}};
}

/* ------------------------------------ algebra.scalar ------------------------------------ */

/* Return the smaller; NaN in either argument is not hidden when it is the second. */
static double minimum(double a, double b)
{
    return a < b ? a : b;
}

/* -------------------------------- laws.predictive.motion -------------------------------- */

/* Write the sum of A^k / (k + 1)! from k = 0 on to `mean`, column after column. */
static void sum_up(double *numbers, const rates_t *rates)
{
    const six_rows_t transposed_2 = transposed(rows(rates));
    const six_t first = times1(transposed_2.e[0], 0.5);
    put_six(&numbers[TERM_AT], first);
    numbers[MEAN_AT] = 1.0 + first.e[0];
    numbers[MEAN_AT + 1] = first.e[1];
    numbers[MEAN_AT + 2] = first.e[2];
    numbers[MEAN_AT + 3] = first.e[3];
    numbers[MEAN_AT + 4] = first.e[4];
    numbers[MEAN_AT + 5] = first.e[5];
    const six_t first_2 = times1(transposed_2.e[1], 0.5);
    put_six(&numbers[TERM_AT + 6], first_2);
    numbers[MEAN_AT + 6] = first_2.e[0];
    numbers[MEAN_AT + 7] = 1.0 + first_2.e[1];
    numbers[MEAN_AT + 8] = first_2.e[2];
    numbers[MEAN_AT + 9] = first_2.e[3];
    numbers[MEAN_AT + 10] = first_2.e[4];
    numbers[MEAN_AT + 11] = first_2.e[5];
    const six_t first_3 = times1(transposed_2.e[2], 0.5);
    put_six(&numbers[TERM_AT + 12], first_3);
    numbers[MEAN_AT + 12] = first_3.e[0];
    numbers[MEAN_AT + 13] = first_3.e[1];
    numbers[MEAN_AT + 14] = 1.0 + first_3.e[2];
    numbers[MEAN_AT + 15] = first_3.e[3];
    numbers[MEAN_AT + 16] = first_3.e[4];
    numbers[MEAN_AT + 17] = first_3.e[5];
    const six_t first_4 = times1(transposed_2.e[3], 0.5);
    put_six(&numbers[TERM_AT + 18], first_4);
    numbers[MEAN_AT + 18] = first_4.e[0];
    numbers[MEAN_AT + 19] = first_4.e[1];
    numbers[MEAN_AT + 20] = first_4.e[2];
    numbers[MEAN_AT + 21] = 1.0 + first_4.e[3];
    numbers[MEAN_AT + 22] = first_4.e[4];
    numbers[MEAN_AT + 23] = first_4.e[5];
    const six_t first_5 = times1(transposed_2.e[4], 0.5);
    put_six(&numbers[TERM_AT + 24], first_5);
    numbers[MEAN_AT + 24] = first_5.e[0];
    numbers[MEAN_AT + 25] = first_5.e[1];
    numbers[MEAN_AT + 26] = first_5.e[2];
    numbers[MEAN_AT + 27] = first_5.e[3];
    numbers[MEAN_AT + 28] = 1.0 + first_5.e[4];
    numbers[MEAN_AT + 29] = first_5.e[5];
    const six_t first_6 = times1(transposed_2.e[5], 0.5);
    put_six(&numbers[TERM_AT + 30], first_6);
    numbers[MEAN_AT + 30] = first_6.e[0];
    numbers[MEAN_AT + 31] = first_6.e[1];
    numbers[MEAN_AT + 32] = first_6.e[2];
    numbers[MEAN_AT + 33] = first_6.e[3];
    numbers[MEAN_AT + 34] = first_6.e[4];
    numbers[MEAN_AT + 35] = 1.0 + first_6.e[5];
    double divisor_ = 3.0;
    bool small_ = false;
    for (int32_t turn = 0; turn < 28; turn++) {
        const double divisor = divisor_;
        const bool small = small_;
        if (small) break;
        bool small1_ = true;
        for (int32_t j = 0; j < 6; j++) {
            const bool small1 = small1_;
            const six_t row = six_at(&numbers[TERM_AT + 6 * j]);
            const six_t product_2 = product(rates, row);
            const double t25 = product_2.e[0] / divisor;
            const double t26 = product_2.e[1] / divisor;
            const double t27 = product_2.e[2] / divisor;
            const double t28 = product_2.e[3] / divisor;
            const double t29 = product_2.e[4] / divisor;
            const double t30 = product_2.e[5] / divisor;
            const six_t entries = {{t25, t26, t27, t28, t29, t30}};
            put_six(&numbers[TERM_AT + 6 * j], entries);
            const six_t row_2 = six_at(&numbers[MEAN_AT + 6 * j]);
            const six_t plus_2 = plus(row_2, entries);
            put_six(&numbers[MEAN_AT + 6 * j], plus_2);
            const double largest = maximum(maximum(maximum(maximum(maximum(t25, t26), t27), t28), t29), t30);
            const double least = minimum(minimum(minimum(minimum(minimum(t25, t26), t27), t28), t29), t30);
            small1_ = small1 && (largest < 1e-21 && -1e-21 < least);
        }
        divisor_ = divisor + 1.0;
        small_ = small1_;
    }
}

/* -------------------------------- laws.predictive.sixes --------------------------------- */

/* Return m x. */
static six_t apply1(six_rows_t m, six_t x)
{
    return (six_t){{dot2(m.e[0], x), dot2(m.e[1], x), dot2(m.e[2], x), dot2(m.e[3], x), dot2(m.e[4], x),
        dot2(m.e[5], x)}};
}

/* -------------------------------- laws.predictive.motion -------------------------------- */

/* Double the time: S becomes (S + exp(A) S) / 2 when each is divided by its own time. */
static void double_of(double *numbers, const rates_t *rates)
{
    for (int32_t j = 0; j < 6; j++) {
        const six_t row = six_at(&numbers[MEAN_AT + 6 * j]);
        const six_t product_2 = product(rates, row);
        put_six(&numbers[TERM_AT + 6 * j], product_2);
    }
    const six_t row_2 = six_at(&numbers[TERM_AT]);
    const six_t row_3 = six_at(&numbers[TERM_AT + 6]);
    const six_t row_4 = six_at(&numbers[TERM_AT + 12]);
    const six_t row_5 = six_at(&numbers[TERM_AT + 18]);
    const six_t row_6 = six_at(&numbers[TERM_AT + 24]);
    const six_t row_7 = six_at(&numbers[TERM_AT + 30]);
    const six_rows_t turned = transposed((six_rows_t){{row_2, row_3, row_4, row_5, row_6, row_7}});
    for (int32_t j1 = 0; j1 < 6; j1++) {
        const six_t before = six_at(&numbers[MEAN_AT + 6 * j1]);
        const six_t apply1_2 = apply1(turned, before);
        numbers[MEAN_AT + 6 * j1] = before.e[0] + 0.5 * apply1_2.e[0];
        numbers[MEAN_AT + 6 * j1 + 1] = before.e[1] + 0.5 * apply1_2.e[1];
        numbers[MEAN_AT + 6 * j1 + 2] = before.e[2] + 0.5 * apply1_2.e[2];
        numbers[MEAN_AT + 6 * j1 + 3] = before.e[3] + 0.5 * apply1_2.e[3];
        numbers[MEAN_AT + 6 * j1 + 4] = before.e[4] + 0.5 * apply1_2.e[4];
        numbers[MEAN_AT + 6 * j1 + 5] = before.e[5] + 0.5 * apply1_2.e[5];
    }
}

static vector_t times2(vector_t row, double c)
{
    return (vector_t){row.x * c, row.y * c, row.z * c};
}

/* Set A and B from S, back in the units of time. */
static void put_motion(double *numbers, const rates_t *rates, matrix_t push, double period)
{
    const six_t row = six_at(&numbers[MEAN_AT]);
    const six_t row_2 = six_at(&numbers[MEAN_AT + 6]);
    const six_t row_3 = six_at(&numbers[MEAN_AT + 12]);
    const six_t row_4 = six_at(&numbers[MEAN_AT + 18]);
    const six_t row_5 = six_at(&numbers[MEAN_AT + 24]);
    const six_t row_6 = six_at(&numbers[MEAN_AT + 30]);
    const six_rows_t a = transposed((six_rows_t){{product(rates, row), product(rates, row_2),
        product(rates, row_3), product(rates, row_4), product(rates, row_5), product(rates, row_6)}});
    const six_rows_t transposed_2 = transposed((six_rows_t){{row, row_2, row_3, row_4, row_5, row_6}});
    const matrix_t transpose_2 = transpose(push);
    const matrix_t transpose_3 = transpose(push);
    const matrix_t transpose_4 = transpose(push);
    const matrix_t transpose_5 = transpose(push);
    const matrix_t transpose_6 = transpose(push);
    const matrix_t transpose_7 = transpose(push);
    const double per = 1.0 / period;
    const vector_t times2_2 = times2((vector_t){a.e[0].e[3], a.e[0].e[4], a.e[0].e[5]}, period);
    const vector_t times2_3 = times2((vector_t){a.e[1].e[3], a.e[1].e[4], a.e[1].e[5]}, period);
    const vector_t times2_4 = times2((vector_t){a.e[2].e[3], a.e[2].e[4], a.e[2].e[5]}, period);
    const vector_t times2_5 = times2((vector_t){a.e[3].e[0], a.e[3].e[1], a.e[3].e[2]}, per);
    const vector_t times2_6 = times2((vector_t){a.e[4].e[0], a.e[4].e[1], a.e[4].e[2]}, per);
    const vector_t times2_7 = times2((vector_t){a.e[5].e[0], a.e[5].e[1], a.e[5].e[2]}, per);
    const vector_t times2_8 = times2((vector_t){dot1((vector_t){transposed_2.e[3].e[3],
        transposed_2.e[3].e[4], transposed_2.e[3].e[5]}, transpose_5.row[0]),
        dot1((vector_t){transposed_2.e[3].e[3], transposed_2.e[3].e[4], transposed_2.e[3].e[5]},
        transpose_5.row[1]), dot1((vector_t){transposed_2.e[3].e[3], transposed_2.e[3].e[4],
        transposed_2.e[3].e[5]}, transpose_5.row[2])}, per);
    const vector_t times2_9 = times2((vector_t){dot1((vector_t){transposed_2.e[4].e[3],
        transposed_2.e[4].e[4], transposed_2.e[4].e[5]}, transpose_6.row[0]),
        dot1((vector_t){transposed_2.e[4].e[3], transposed_2.e[4].e[4], transposed_2.e[4].e[5]},
        transpose_6.row[1]), dot1((vector_t){transposed_2.e[4].e[3], transposed_2.e[4].e[4],
        transposed_2.e[4].e[5]}, transpose_6.row[2])}, per);
    const vector_t times2_10 = times2((vector_t){dot1((vector_t){transposed_2.e[5].e[3],
        transposed_2.e[5].e[4], transposed_2.e[5].e[5]}, transpose_7.row[0]),
        dot1((vector_t){transposed_2.e[5].e[3], transposed_2.e[5].e[4], transposed_2.e[5].e[5]},
        transpose_7.row[1]), dot1((vector_t){transposed_2.e[5].e[3], transposed_2.e[5].e[4],
        transposed_2.e[5].e[5]}, transpose_7.row[2])}, per);
    numbers[MOTION_AT] = 1.0 + a.e[0].e[0];
    numbers[MOTION_AT + 1] = a.e[0].e[1];
    numbers[MOTION_AT + 2] = a.e[0].e[2];
    numbers[MOTION_AT + 3] = times2_2.x;
    numbers[MOTION_AT + 4] = times2_2.y;
    numbers[MOTION_AT + 5] = times2_2.z;
    numbers[MOTION_AT + 6] = a.e[1].e[0];
    numbers[MOTION_AT + 7] = 1.0 + a.e[1].e[1];
    numbers[MOTION_AT + 8] = a.e[1].e[2];
    numbers[MOTION_AT + 9] = times2_3.x;
    numbers[MOTION_AT + 10] = times2_3.y;
    numbers[MOTION_AT + 11] = times2_3.z;
    numbers[MOTION_AT + 12] = a.e[2].e[0];
    numbers[MOTION_AT + 13] = a.e[2].e[1];
    numbers[MOTION_AT + 14] = 1.0 + a.e[2].e[2];
    numbers[MOTION_AT + 15] = times2_4.x;
    numbers[MOTION_AT + 16] = times2_4.y;
    numbers[MOTION_AT + 17] = times2_4.z;
    numbers[MOTION_AT + 18] = times2_5.x;
    numbers[MOTION_AT + 19] = times2_5.y;
    numbers[MOTION_AT + 20] = times2_5.z;
    numbers[MOTION_AT + 21] = 1.0 + a.e[3].e[3];
    numbers[MOTION_AT + 22] = a.e[3].e[4];
    numbers[MOTION_AT + 23] = a.e[3].e[5];
    numbers[MOTION_AT + 24] = times2_6.x;
    numbers[MOTION_AT + 25] = times2_6.y;
    numbers[MOTION_AT + 26] = times2_6.z;
    numbers[MOTION_AT + 27] = a.e[4].e[3];
    numbers[MOTION_AT + 28] = 1.0 + a.e[4].e[4];
    numbers[MOTION_AT + 29] = a.e[4].e[5];
    numbers[MOTION_AT + 30] = times2_7.x;
    numbers[MOTION_AT + 31] = times2_7.y;
    numbers[MOTION_AT + 32] = times2_7.z;
    numbers[MOTION_AT + 33] = a.e[5].e[3];
    numbers[MOTION_AT + 34] = a.e[5].e[4];
    numbers[MOTION_AT + 35] = 1.0 + a.e[5].e[5];
    numbers[MOTION_AT + 36] = dot1((vector_t){transposed_2.e[0].e[3], transposed_2.e[0].e[4],
        transposed_2.e[0].e[5]}, transpose_2.row[0]);
    numbers[MOTION_AT + 37] = dot1((vector_t){transposed_2.e[0].e[3], transposed_2.e[0].e[4],
        transposed_2.e[0].e[5]}, transpose_2.row[1]);
    numbers[MOTION_AT + 38] = dot1((vector_t){transposed_2.e[0].e[3], transposed_2.e[0].e[4],
        transposed_2.e[0].e[5]}, transpose_2.row[2]);
    numbers[MOTION_AT + 39] = dot1((vector_t){transposed_2.e[1].e[3], transposed_2.e[1].e[4],
        transposed_2.e[1].e[5]}, transpose_3.row[0]);
    numbers[MOTION_AT + 40] = dot1((vector_t){transposed_2.e[1].e[3], transposed_2.e[1].e[4],
        transposed_2.e[1].e[5]}, transpose_3.row[1]);
    numbers[MOTION_AT + 41] = dot1((vector_t){transposed_2.e[1].e[3], transposed_2.e[1].e[4],
        transposed_2.e[1].e[5]}, transpose_3.row[2]);
    numbers[MOTION_AT + 42] = dot1((vector_t){transposed_2.e[2].e[3], transposed_2.e[2].e[4],
        transposed_2.e[2].e[5]}, transpose_4.row[0]);
    numbers[MOTION_AT + 43] = dot1((vector_t){transposed_2.e[2].e[3], transposed_2.e[2].e[4],
        transposed_2.e[2].e[5]}, transpose_4.row[1]);
    numbers[MOTION_AT + 44] = dot1((vector_t){transposed_2.e[2].e[3], transposed_2.e[2].e[4],
        transposed_2.e[2].e[5]}, transpose_4.row[2]);
    numbers[MOTION_AT + 45] = times2_8.x;
    numbers[MOTION_AT + 46] = times2_8.y;
    numbers[MOTION_AT + 47] = times2_8.z;
    numbers[MOTION_AT + 48] = times2_9.x;
    numbers[MOTION_AT + 49] = times2_9.y;
    numbers[MOTION_AT + 50] = times2_9.z;
    numbers[MOTION_AT + 51] = times2_10.x;
    numbers[MOTION_AT + 52] = times2_10.y;
    numbers[MOTION_AT + 53] = times2_10.z;
}

/* Sample exactly with a held input: A = exp(A h), B = (integral of exp(A s) over 0..h) B of the problem. */
static void sample(double *numbers, const linear_t *linear, double period)
{
    const double square = period * period;
    const matrix_t scaled_2 = scaled(linear->turning, period);
    const matrix_t scaled_3 = scaled(linear->stiffness, square);
    const matrix_t scaled_4 = scaled(linear->damping, period);
    const rates_t rates = {.turning = scaled_2, .half = 0.5, .stiffness = scaled_3, .damping = scaled_4};
    const share_result_t share_result = share_1(&rates);
    const rates_t during_2 = during(&rates, share_result.share);
    sum_up(numbers, &during_2);
    double share_ = share_result.share;
    double left_ = share_result.count;
    for (int32_t turn = 0; turn < 60; turn++) {
        const double share = share_;
        const double left = left_;
        if (left <= 0.0) break;
        const rates_t during_3 = during(&rates, share);
        double_of(numbers, &during_3);
        share_ = 2.0 * share;
        left_ = left - 1.0;
    }
    put_motion(numbers, &rates, scaled(linear->push, square), period);
}

/* ------------------------------- laws.predictive.problem -------------------------------- */

/* Set the limits: their centre and their bound (inf: none). */
static void put_limits(double *numbers, vector_t centre, double bound)
{
    put_vector(&numbers[LIMITS_AT], centre);
    numbers[LIMITS_AT + 3] = bound;
}

/* -------------------------------- laws.predictive.sixes --------------------------------- */

/* Return the k-th three numbers of a buffer. */
static vector_t triple(double *numbers)
{
    const vector_t row = vector_at(&numbers[LIMITS_AT]);
    return row;
}

/* ------------------------------- laws.predictive.problem -------------------------------- */

/* Return the limits of every move. */
static limits_t limits(double *numbers)
{
    const vector_t centre = triple(numbers);
    const double bound = numbers[LIMITS_AT + 3];
    return (limits_t){.centre = centre, .bound = bound,
        .low = subtract(centre, (vector_t){bound, bound, bound}),
        .high = add(centre, (vector_t){bound, bound, bound})};
}

/* -------------------------------- laws.predictive.limits -------------------------------- */

/* Return the point within the limits nearest to v, and whether v was outside. */
static project_result_t project(const limits_t *limits, vector_t v)
{
    const bool t10 = limits->low.x <= v.x && v.x <= limits->high.x && (limits->low.y <= v.y && v.y <=
        limits->high.y);
    const vector_t w = {minimum(limits->high.x, maximum(limits->low.x, v.x)),
        minimum(limits->high.y, maximum(limits->low.y, v.y)),
        minimum(limits->high.z, maximum(limits->low.z, v.z))};
    return (project_result_t){.w = w, .truth = !(t10 && (limits->low.z <= v.z && v.z <= limits->high.z))};
}

/* -------------------------------- laws.predictive.solver -------------------------------- */

/* Shift a solved plan by one move; the last is what the tail gives at its end. */
static void advance(double *numbers)
{
    const limits_t bounds = limits(numbers);
    const six_t row = six_at(&numbers[STATES_AT + 60]);
    const double y = -row.e[0];
    const double y_2 = -row.e[1];
    const double y_3 = -row.e[2];
    const double y_4 = -row.e[3];
    const double y_5 = -row.e[4];
    const double y_6 = -row.e[5];
    const six_t a = six_at(&numbers[TAIL_AT]);
    const double t28 = 0.0 + a.e[0] * y + a.e[1] * y_2 + a.e[2] * y_3 + a.e[3] * y_4 + a.e[4] * y_5;
    const six_t a_2 = six_at(&numbers[TAIL_AT + 6]);
    const double t46 = 0.0 + a_2.e[0] * y + a_2.e[1] * y_2 + a_2.e[2] * y_3 + a_2.e[3] * y_4 + a_2.e[4] * y_5;
    const six_t a_3 = six_at(&numbers[TAIL_AT + 12]);
    const double t64 = 0.0 + a_3.e[0] * y + a_3.e[1] * y_2 + a_3.e[2] * y_3 + a_3.e[3] * y_4 + a_3.e[4] * y_5;
    const double total = t64 + a_3.e[5] * y_6;
    for (int32_t k = 0; k < 9; k++) {
        const vector_t row_2 = vector_at(&numbers[PLAN_AT + 3 * k + 3]);
        const project_result_t project_result = project(&bounds, row_2);
        put_vector(&numbers[PLAN_AT + 3 * k], project_result.w);
    }
    const project_result_t project_result_2 = project(&bounds,
        (vector_t){t28 + a.e[5] * y_6, t46 + a_2.e[5] * y_6, total});
    put_vector(&numbers[PLAN_AT + 27], project_result_2.w);
}

/* -------------------------------- laws.predictive.sixes --------------------------------- */

/* A buffer holds a matrix row after row. */
static six_rows_t matrix(double *numbers)
{
    const six_t row = six_at(&numbers[MOTION_AT]);
    const six_t row_2 = six_at(&numbers[MOTION_AT + 6]);
    const six_t row_3 = six_at(&numbers[MOTION_AT + 12]);
    const six_t row_4 = six_at(&numbers[MOTION_AT + 18]);
    const six_t row_5 = six_at(&numbers[MOTION_AT + 24]);
    const six_t row_6 = six_at(&numbers[MOTION_AT + 30]);
    return (six_rows_t){{row, row_2, row_3, row_4, row_5, row_6}};
}

/* A buffer holds a matrix row after row. */
static six_vectors_t matrix1(double *numbers)
{
    const six_t row = six_at(&numbers[MOTION_AT + 36]);
    const six_t row_2 = six_at(&numbers[MOTION_AT + 42]);
    const six_t row_3 = six_at(&numbers[MOTION_AT + 48]);
    return (six_vectors_t){{{row.e[0], row.e[1], row.e[2]}, {row.e[3], row.e[4], row.e[5]},
        {row_2.e[0], row_2.e[1], row_2.e[2]}, {row_2.e[3], row_2.e[4], row_2.e[5]},
        {row_3.e[0], row_3.e[1], row_3.e[2]}, {row_3.e[3], row_3.e[4], row_3.e[5]}}};
}

/* ------------------------------- laws.predictive.problem -------------------------------- */

/* Return A (6, 6) and B (6, 3). */
static motion_result_t motion(double *numbers)
{
    const six_rows_t matrix_2 = matrix(numbers);
    const six_vectors_t matrix1_2 = matrix1(numbers);
    return (motion_result_t){.rows = matrix_2, .rows1 = matrix1_2};
}

/* -------------------------------- laws.predictive.sixes --------------------------------- */

/* A buffer holds a matrix row after row. */
static six_rows_t matrix2(double *numbers)
{
    const six_t row = six_at(&numbers[WEIGHTS_AT + 12]);
    const six_t row_2 = six_at(&numbers[WEIGHTS_AT + 18]);
    const six_t row_3 = six_at(&numbers[WEIGHTS_AT + 24]);
    const six_t row_4 = six_at(&numbers[WEIGHTS_AT + 30]);
    const six_t row_5 = six_at(&numbers[WEIGHTS_AT + 36]);
    const six_t row_6 = six_at(&numbers[WEIGHTS_AT + 42]);
    return (six_rows_t){{row, row_2, row_3, row_4, row_5, row_6}};
}

/* ------------------------------- laws.predictive.problem -------------------------------- */

/* Return the weights of the cost. */
static weights_t weights(double *numbers)
{
    const six_t row = six_at(&numbers[WEIGHTS_AT]);
    const six_t row_2 = six_at(&numbers[WEIGHTS_AT + 6]);
    const six_rows_t matrix2_2 = matrix2(numbers);
    return (weights_t){.q = row, .r = {row_2.e[0], row_2.e[1], row_2.e[2]},
        .r_inverse = {row_2.e[3], row_2.e[4], row_2.e[5]}, .p = matrix2_2};
}

/* -------------------------------- laws.predictive.sixes --------------------------------- */

/* Return the transposed matrix. */
static sixs3_t transposed1(six_vectors_t m)
{
    return (sixs3_t){{{{m.e[0].x, m.e[1].x, m.e[2].x, m.e[3].x, m.e[4].x, m.e[5].x}},
        {{m.e[0].y, m.e[1].y, m.e[2].y, m.e[3].y, m.e[4].y, m.e[5].y}},
        {{m.e[0].z, m.e[1].z, m.e[2].z, m.e[3].z, m.e[4].z, m.e[5].z}}}};
}

/* Return m n. */
static six_rows_t product1(six_rows_t m, six_rows_t n)
{
    const six_rows_t columns = transposed(n);
    return (six_rows_t){{apply1(columns, m.e[0]), apply1(columns, m.e[1]), apply1(columns, m.e[2]),
        apply1(columns, m.e[3]), apply1(columns, m.e[4]), apply1(columns, m.e[5])}};
}

/* Return m x. */
static vector_t apply2(sixs3_t m, six_t x)
{
    return (vector_t){dot2(m.e[0], x), dot2(m.e[1], x), dot2(m.e[2], x)};
}

/* Return m n. */
static six_vectors_t product2(six_rows_t m, six_vectors_t n)
{
    const sixs3_t columns = transposed1(n);
    return (six_vectors_t){{apply2(columns, m.e[0]), apply2(columns, m.e[1]), apply2(columns, m.e[2]),
        apply2(columns, m.e[3]), apply2(columns, m.e[4]), apply2(columns, m.e[5])}};
}

/* Return the transposed matrix. */
static six_vectors_t transposed2(sixs3_t m)
{
    return (six_vectors_t){{{m.e[0].e[0], m.e[1].e[0], m.e[2].e[0]}, {m.e[0].e[1], m.e[1].e[1], m.e[2].e[1]},
        {m.e[0].e[2], m.e[1].e[2], m.e[2].e[2]}, {m.e[0].e[3], m.e[1].e[3], m.e[2].e[3]},
        {m.e[0].e[4], m.e[1].e[4], m.e[2].e[4]}, {m.e[0].e[5], m.e[1].e[5], m.e[2].e[5]}}};
}

/* Return the number in row i and column j. */
static double entry(vector_t m)
{
    return m.x;
}

/* Return start + a'b. */
static double dot3(six_t a, six_t b, double start)
{
    const double t8 = start + a.e[0] * b.e[0] + a.e[1] * b.e[1] + a.e[2] * b.e[2] + a.e[3] * b.e[3];
    const double total = t8 + a.e[4] * b.e[4] + a.e[5] * b.e[5];
    return total;
}

/* Return the number in row i and column j. */
static double entry1(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry2(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry3(vector_t m)
{
    return m.y;
}

/* Return the number in row i and column j. */
static double entry4(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry5(vector_t m)
{
    return m.z;
}

/* ------------------------------- laws.predictive.horizon -------------------------------- */

/* Return R + B'P B. */
static six_t curvature_1(vector_t r, sixs3_t pushes, sixs3_t pushed)
{
    return (six_t){{dot3(pushes.e[0], pushed.e[0], entry(r)), dot3(pushes.e[0], pushed.e[1], entry1()),
        dot3(pushes.e[0], pushed.e[2], entry2()), dot3(pushes.e[1], pushed.e[1], entry3(r)),
        dot3(pushes.e[1], pushed.e[2], entry4()), dot3(pushes.e[2], pushed.e[2], entry5(r))}};
}

/* -------------------------------- laws.predictive.limits -------------------------------- */

/* Return (bound2 - d2)/2 for d = v - centre: on each axis of a box, or thrice that of a ball; positive
   inside. */
static vector_t slack(const limits_t *limits, vector_t v)
{
    const vector_t d = subtract(v, limits->centre);
    return (vector_t){0.5 * (limits->bound - d.x) * (limits->bound + d.x),
        0.5 * (limits->bound - d.y) * (limits->bound + d.y),
        0.5 * (limits->bound - d.z) * (limits->bound + d.z)};
}

/* Return a symmetric matrix with the curvature of the limits added, and their push: the interior-point
   step. */
static repelled_result_t repelled(const limits_t *limits, vector_t v, vector_t multipliers, double barrier,
    six_t m)
{
    const vector_t d = subtract(v, limits->centre);
    const vector_t s = slack(limits, v);
    const vector_t push = times((vector_t){barrier / s.x, barrier / s.y, barrier / s.z}, d);
    return (repelled_result_t){.symmetric = {{m.e[0] + multipliers.x * (1.0 + d.x * d.x / s.x), m.e[1],
        m.e[2], m.e[3] + multipliers.y * (1.0 + d.y * d.y / s.y), m.e[4],
        m.e[5] + multipliers.z * (1.0 + d.z * d.z / s.z)}}, .push = push};
}

/* Tell which axes of a box press against a limit, for the gradient g. */
static bools3_t held(const limits_t *limits, vector_t v, vector_t g)
{
    const bool t7 = (g.x < 0.0 && limits->high.x <= v.x) || (0.0 < g.x && v.x <= limits->low.x);
    const bool t14 = (g.y < 0.0 && limits->high.y <= v.y) || (0.0 < g.y && v.y <= limits->low.y);
    const bool above = g.z < 0.0 && limits->high.z <= v.z;
    return (bools3_t){{t7, t14, above || (0.0 < g.z && v.z <= limits->low.z)}};
}

/* Return the inverse of a symmetric matrix. */
static six_t inverse(six_t m)
{
    const double c0 = m.e[3] * m.e[5] - m.e[4] * m.e[4];
    const double c1 = m.e[2] * m.e[4] - m.e[1] * m.e[5];
    const double c2 = m.e[1] * m.e[4] - m.e[2] * m.e[3];
    const double s = 1.0 / (m.e[0] * c0 + m.e[1] * c1 + m.e[2] * c2);
    const double d0 = m.e[0] * m.e[5] - m.e[2] * m.e[2];
    const double d1 = m.e[1] * m.e[2] - m.e[0] * m.e[4];
    return (six_t){{s * c0, s * c1, s * c2, s * d0, s * d1, s * (m.e[0] * m.e[3] - m.e[1] * m.e[1])}};
}

/* Return the inverse of a symmetric matrix on the axes that are not fixed, zero on the others. */
static six_t box_inverse(six_t m, bools3_t fixed)
{
    const six_t w = inverse((six_t){{fixed.e[0] ? 1.0 : m.e[0], fixed.e[0] || fixed.e[1] ? 0.0 : m.e[1],
        fixed.e[0] || fixed.e[2] ? 0.0 : m.e[2], fixed.e[1] ? 1.0 : m.e[3],
        fixed.e[1] || fixed.e[2] ? 0.0 : m.e[4], fixed.e[2] ? 1.0 : m.e[5]}});
    return (six_t){{fixed.e[0] ? 0.0 : w.e[0], w.e[1], w.e[2], fixed.e[1] ? 0.0 : w.e[3], w.e[4],
        fixed.e[2] ? 0.0 : w.e[5]}};
}

/* ------------------------------- laws.predictive.horizon -------------------------------- */

/* Return the inverse of m on what no limit holds, and the number of limits that hold. */
static held_inverse_result_t held_inverse(const limits_t *bounds, vector_t v, vector_t g, six_t m, bool holds)
{
    const bools3_t held_2 = held(bounds, v, g);
    const bool t1 = holds && held_2.e[0];
    const bool t2 = holds && held_2.e[1];
    const bool t3 = holds && held_2.e[2];
    return (held_inverse_result_t){.symmetric = box_inverse(m, (bools3_t){{t1, t2, t3}}),
        .scalar = (t1 ? 1.0 : 0.0) + (t2 ? 1.0 : 0.0) + (t3 ? 1.0 : 0.0)};
}

/* Return -w x. */
static vector_t minus(six_t w, vector_t x)
{
    return (vector_t){-(w.e[0] * x.x + w.e[1] * x.y + w.e[2] * x.z),
        -(w.e[1] * x.x + w.e[3] * x.y + w.e[4] * x.z), -(w.e[2] * x.x + w.e[4] * x.y + w.e[5] * x.z)};
}

/* -------------------------------- laws.predictive.sixes --------------------------------- */

/* Return the number in row i and column j. */
static double entry6(six_t m)
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
static double entry7(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry8(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry9(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry10(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry11(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry12(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry13(six_t m)
{
    return m.e[1];
}

/* Return the number in row i and column j. */
static double entry14(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry15(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry16(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry17(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry18(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry19(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry20(six_t m)
{
    return m.e[2];
}

/* Return the number in row i and column j. */
static double entry21(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry22(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry23(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry24(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry25(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry26(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry27(six_t m)
{
    return m.e[3];
}

/* Return the number in row i and column j. */
static double entry28(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry29(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry30(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry31(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry32(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry33(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry34(six_t m)
{
    return m.e[4];
}

/* Return the number in row i and column j. */
static double entry35(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry36(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry37(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry38(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry39(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry40(void)
{
    return 0.0;
}

/* Return the number in row i and column j. */
static double entry41(six_t m)
{
    return m.e[5];
}

/* ------------------------------- laws.predictive.horizon -------------------------------- */

/* Keep the matrix symmetric against rounding, which long horizons would amplify. */
static six_rows_t symmetric(six_rows_t m)
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
    return (six_rows_t){{{{m.e[0].e[0], t2, t4, t6, t8, t10}}, {{t2, m.e[1].e[1], t12, t14, t16, t18}},
        {{t4, t12, m.e[2].e[2], t20, t22, t24}}, {{t6, t14, t20, m.e[3].e[3], t26, t28}},
        {{t8, t16, t22, t26, m.e[4].e[4], t30}}, {{t10, t18, t24, t28, t30, m.e[5].e[5]}}}};
}

/* Find the Newton step by one backward Riccati sweep, as a policy: step + feedback (x - x of the plan). */
static sweep_result_t sweep(double *numbers, double barrier)
{
    const motion_result_t motion_result = motion(numbers);
    const weights_t weights_2 = weights(numbers);
    const limits_t bounds = limits(numbers);
    const six_rows_t columns = transposed(motion_result.rows);
    const sixs3_t pushes = transposed1(motion_result.rows1);
    const bool holds = barrier <= 0.0;
    double curvature_ = weights_2.p.e[0].e[0];
    double curvature1_ = weights_2.p.e[0].e[1];
    double curvature2_ = weights_2.p.e[0].e[2];
    double curvature3_ = weights_2.p.e[0].e[3];
    double curvature4_ = weights_2.p.e[0].e[4];
    double curvature5_ = weights_2.p.e[0].e[5];
    double curvature6_ = weights_2.p.e[1].e[0];
    double curvature7_ = weights_2.p.e[1].e[1];
    double curvature8_ = weights_2.p.e[1].e[2];
    double curvature9_ = weights_2.p.e[1].e[3];
    double curvature10_ = weights_2.p.e[1].e[4];
    double curvature11_ = weights_2.p.e[1].e[5];
    double curvature12_ = weights_2.p.e[2].e[0];
    double curvature13_ = weights_2.p.e[2].e[1];
    double curvature14_ = weights_2.p.e[2].e[2];
    double curvature15_ = weights_2.p.e[2].e[3];
    double curvature16_ = weights_2.p.e[2].e[4];
    double curvature17_ = weights_2.p.e[2].e[5];
    double curvature18_ = weights_2.p.e[3].e[0];
    double curvature19_ = weights_2.p.e[3].e[1];
    double curvature20_ = weights_2.p.e[3].e[2];
    double curvature21_ = weights_2.p.e[3].e[3];
    double curvature22_ = weights_2.p.e[3].e[4];
    double curvature23_ = weights_2.p.e[3].e[5];
    double curvature24_ = weights_2.p.e[4].e[0];
    double curvature25_ = weights_2.p.e[4].e[1];
    double curvature26_ = weights_2.p.e[4].e[2];
    double curvature27_ = weights_2.p.e[4].e[3];
    double curvature28_ = weights_2.p.e[4].e[4];
    double curvature29_ = weights_2.p.e[4].e[5];
    double curvature30_ = weights_2.p.e[5].e[0];
    double curvature31_ = weights_2.p.e[5].e[1];
    double curvature32_ = weights_2.p.e[5].e[2];
    double curvature33_ = weights_2.p.e[5].e[3];
    double curvature34_ = weights_2.p.e[5].e[4];
    double curvature35_ = weights_2.p.e[5].e[5];
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
        const six_rows_t product1_2 = product1((six_rows_t){{{{curvature, curvature1, curvature2, curvature3,
            curvature4, curvature5}}, {{curvature6, curvature7, curvature8, curvature9, curvature10,
            curvature11}}, {{curvature12, curvature13, curvature14, curvature15, curvature16, curvature17}},
            {{curvature18, curvature19, curvature20, curvature21, curvature22, curvature23}}, {{curvature24,
            curvature25, curvature26, curvature27, curvature28, curvature29}}, {{curvature30, curvature31,
            curvature32, curvature33, curvature34, curvature35}}}}, motion_result.rows);
        const six_rows_t onward = transposed(product1_2);
        const six_vectors_t product2_2 = product2((six_rows_t){{{{curvature, curvature1, curvature2,
            curvature3, curvature4, curvature5}}, {{curvature6, curvature7, curvature8, curvature9,
            curvature10, curvature11}}, {{curvature12, curvature13, curvature14, curvature15, curvature16,
            curvature17}}, {{curvature18, curvature19, curvature20, curvature21, curvature22, curvature23}},
            {{curvature24, curvature25, curvature26, curvature27, curvature28, curvature29}}, {{curvature30,
            curvature31, curvature32, curvature33, curvature34, curvature35}}}}, motion_result.rows1);
        const sixs3_t pushed = transposed1(product2_2);
        const six_vectors_t cross_2 = transposed2((sixs3_t){{apply1(onward, pushes.e[0]),
            apply1(onward, pushes.e[1]), apply1(onward, pushes.e[2])}});
        const six_t m_2 = curvature_1(weights_2.r, pushes, pushed);
        numbers[STIFFNESS_AT + (9 - back)] = m_2.e[0] + m_2.e[3] + m_2.e[5];
        const vector_t v = vector_at(&numbers[PLAN_AT + 3 * (9 - back)]);
        const vector_t pull = vector_at(&numbers[GRADIENT_AT + 3 * (9 - back)]);
        const vector_t g_2 = add(apply2(pushes, (six_t){{slope, slope1, slope2, slope3, slope4, slope5}}),
            pull);
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
            const vector_t row = vector_at(&numbers[MULTIPLIERS_AT + 3 * (9 - back)]);
            const repelled_result_t repelled_result = repelled(&bounds, v, row, barrier, m_2);
            const vector_t add_2 = add(g_2, repelled_result.push);
            m_ = repelled_result.symmetric.e[0];
            m1_ = repelled_result.symmetric.e[1];
            m2_ = repelled_result.symmetric.e[2];
            m3_ = repelled_result.symmetric.e[3];
            m4_ = repelled_result.symmetric.e[4];
            m5_ = repelled_result.symmetric.e[5];
            g_ = add_2.x;
            g1_ = add_2.y;
            g2_ = add_2.z;
        }
        const held_inverse_result_t held_inverse_result = held_inverse(&bounds, v, pull,
            (six_t){{m_, m1_, m2_, m3_, m4_, m5_}}, holds);
        const vector_t step_2 = minus(held_inverse_result.symmetric, (vector_t){g_, g1_, g2_});
        const vector_t minus_2 = minus(held_inverse_result.symmetric, cross_2.e[0]);
        const vector_t minus_3 = minus(held_inverse_result.symmetric, cross_2.e[1]);
        const vector_t minus_4 = minus(held_inverse_result.symmetric, cross_2.e[2]);
        const vector_t minus_5 = minus(held_inverse_result.symmetric, cross_2.e[3]);
        const vector_t minus_6 = minus(held_inverse_result.symmetric, cross_2.e[4]);
        const vector_t minus_7 = minus(held_inverse_result.symmetric, cross_2.e[5]);
        put_vector(&numbers[STEP_AT + 3 * (9 - back)], step_2);
        const sixs3_t transposed1_2 = transposed1((six_vectors_t){{minus_2, minus_3, minus_4, minus_5,
            minus_6, minus_7}});
        put_six(&numbers[FEEDBACK_AT + 18 * (9 - back)], transposed1_2.e[0]);
        put_six(&numbers[FEEDBACK_AT + 18 * (9 - back) + 6], transposed1_2.e[1]);
        put_six(&numbers[FEEDBACK_AT + 18 * (9 - back) + 12], transposed1_2.e[2]);
        const six_rows_t symmetric_2 = symmetric((six_rows_t){{{{dot3(columns.e[0], onward.e[0],
            dot4(cross_2.e[0], minus_2, entry6(weights_2.q))), dot3(columns.e[0], onward.e[1],
            dot4(cross_2.e[0], minus_3, entry7())), dot3(columns.e[0], onward.e[2],
            dot4(cross_2.e[0], minus_4, entry8())), dot3(columns.e[0], onward.e[3],
            dot4(cross_2.e[0], minus_5, entry9())), dot3(columns.e[0], onward.e[4],
            dot4(cross_2.e[0], minus_6, entry10())), dot3(columns.e[0], onward.e[5],
            dot4(cross_2.e[0], minus_7, entry11()))}}, {{dot3(columns.e[1], onward.e[0],
            dot4(cross_2.e[1], minus_2, entry12())), dot3(columns.e[1], onward.e[1],
            dot4(cross_2.e[1], minus_3, entry13(weights_2.q))), dot3(columns.e[1], onward.e[2],
            dot4(cross_2.e[1], minus_4, entry14())), dot3(columns.e[1], onward.e[3],
            dot4(cross_2.e[1], minus_5, entry15())), dot3(columns.e[1], onward.e[4],
            dot4(cross_2.e[1], minus_6, entry16())), dot3(columns.e[1], onward.e[5],
            dot4(cross_2.e[1], minus_7, entry17()))}}, {{dot3(columns.e[2], onward.e[0],
            dot4(cross_2.e[2], minus_2, entry18())), dot3(columns.e[2], onward.e[1],
            dot4(cross_2.e[2], minus_3, entry19())), dot3(columns.e[2], onward.e[2],
            dot4(cross_2.e[2], minus_4, entry20(weights_2.q))), dot3(columns.e[2], onward.e[3],
            dot4(cross_2.e[2], minus_5, entry21())), dot3(columns.e[2], onward.e[4],
            dot4(cross_2.e[2], minus_6, entry22())), dot3(columns.e[2], onward.e[5],
            dot4(cross_2.e[2], minus_7, entry23()))}}, {{dot3(columns.e[3], onward.e[0],
            dot4(cross_2.e[3], minus_2, entry24())), dot3(columns.e[3], onward.e[1],
            dot4(cross_2.e[3], minus_3, entry25())), dot3(columns.e[3], onward.e[2],
            dot4(cross_2.e[3], minus_4, entry26())), dot3(columns.e[3], onward.e[3],
            dot4(cross_2.e[3], minus_5, entry27(weights_2.q))), dot3(columns.e[3], onward.e[4],
            dot4(cross_2.e[3], minus_6, entry28())), dot3(columns.e[3], onward.e[5],
            dot4(cross_2.e[3], minus_7, entry29()))}}, {{dot3(columns.e[4], onward.e[0],
            dot4(cross_2.e[4], minus_2, entry30())), dot3(columns.e[4], onward.e[1],
            dot4(cross_2.e[4], minus_3, entry31())), dot3(columns.e[4], onward.e[2],
            dot4(cross_2.e[4], minus_4, entry32())), dot3(columns.e[4], onward.e[3],
            dot4(cross_2.e[4], minus_5, entry33())), dot3(columns.e[4], onward.e[4],
            dot4(cross_2.e[4], minus_6, entry34(weights_2.q))), dot3(columns.e[4], onward.e[5],
            dot4(cross_2.e[4], minus_7, entry35()))}}, {{dot3(columns.e[5], onward.e[0],
            dot4(cross_2.e[5], minus_2, entry36())), dot3(columns.e[5], onward.e[1],
            dot4(cross_2.e[5], minus_3, entry37())), dot3(columns.e[5], onward.e[2],
            dot4(cross_2.e[5], minus_4, entry38())), dot3(columns.e[5], onward.e[3],
            dot4(cross_2.e[5], minus_5, entry39())), dot3(columns.e[5], onward.e[4],
            dot4(cross_2.e[5], minus_6, entry40())), dot3(columns.e[5], onward.e[5],
            dot4(cross_2.e[5], minus_7, entry41(weights_2.q)))}}}});
        curvature_ = symmetric_2.e[0].e[0];
        curvature1_ = symmetric_2.e[0].e[1];
        curvature2_ = symmetric_2.e[0].e[2];
        curvature3_ = symmetric_2.e[0].e[3];
        curvature4_ = symmetric_2.e[0].e[4];
        curvature5_ = symmetric_2.e[0].e[5];
        curvature6_ = symmetric_2.e[1].e[0];
        curvature7_ = symmetric_2.e[1].e[1];
        curvature8_ = symmetric_2.e[1].e[2];
        curvature9_ = symmetric_2.e[1].e[3];
        curvature10_ = symmetric_2.e[1].e[4];
        curvature11_ = symmetric_2.e[1].e[5];
        curvature12_ = symmetric_2.e[2].e[0];
        curvature13_ = symmetric_2.e[2].e[1];
        curvature14_ = symmetric_2.e[2].e[2];
        curvature15_ = symmetric_2.e[2].e[3];
        curvature16_ = symmetric_2.e[2].e[4];
        curvature17_ = symmetric_2.e[2].e[5];
        curvature18_ = symmetric_2.e[3].e[0];
        curvature19_ = symmetric_2.e[3].e[1];
        curvature20_ = symmetric_2.e[3].e[2];
        curvature21_ = symmetric_2.e[3].e[3];
        curvature22_ = symmetric_2.e[3].e[4];
        curvature23_ = symmetric_2.e[3].e[5];
        curvature24_ = symmetric_2.e[4].e[0];
        curvature25_ = symmetric_2.e[4].e[1];
        curvature26_ = symmetric_2.e[4].e[2];
        curvature27_ = symmetric_2.e[4].e[3];
        curvature28_ = symmetric_2.e[4].e[4];
        curvature29_ = symmetric_2.e[4].e[5];
        curvature30_ = symmetric_2.e[5].e[0];
        curvature31_ = symmetric_2.e[5].e[1];
        curvature32_ = symmetric_2.e[5].e[2];
        curvature33_ = symmetric_2.e[5].e[3];
        curvature34_ = symmetric_2.e[5].e[4];
        curvature35_ = symmetric_2.e[5].e[5];
        slope_ = dot3(columns.e[0], (six_t){{slope, slope1, slope2, slope3, slope4, slope5}},
            dot(cross_2.e[0], step_2));
        slope1_ = dot3(columns.e[1], (six_t){{slope, slope1, slope2, slope3, slope4, slope5}},
            dot(cross_2.e[1], step_2));
        slope2_ = dot3(columns.e[2], (six_t){{slope, slope1, slope2, slope3, slope4, slope5}},
            dot(cross_2.e[2], step_2));
        slope3_ = dot3(columns.e[3], (six_t){{slope, slope1, slope2, slope3, slope4, slope5}},
            dot(cross_2.e[3], step_2));
        slope4_ = dot3(columns.e[4], (six_t){{slope, slope1, slope2, slope3, slope4, slope5}},
            dot(cross_2.e[4], step_2));
        slope5_ = dot3(columns.e[5], (six_t){{slope, slope1, slope2, slope3, slope4, slope5}},
            dot(cross_2.e[5], step_2));
        decrement_ = decrement - dot(step_2, (vector_t){g_, g1_, g2_});
        holding_ = holding + held_inverse_result.scalar;
    }
    return (sweep_result_t){.scalar = decrement_, .scalar1 = holding_};
}

/* Return A x + B v. */
static six_t transition(six_rows_t a, six_vectors_t b, six_t x, vector_t v)
{
    return (six_t){{dot3(a.e[0], x, dot(b.e[0], v)), dot3(a.e[1], x, dot(b.e[1], v)),
        dot3(a.e[2], x, dot(b.e[2], v)), dot3(a.e[3], x, dot(b.e[3], v)), dot3(a.e[4], x, dot(b.e[4], v)),
        dot3(a.e[5], x, dot(b.e[5], v))}};
}

/* -------------------------------- laws.predictive.sixes --------------------------------- */

/* Return x'm x. */
static double form(vector_t m, vector_t x)
{
    const double x_2 = m.z * x.z;
    const double total = 0.0 + m.x * x.x * x.x + m.y * x.y * x.y + x_2 * x.z;
    return total;
}

/* Return x'm x. */
static double form1(six_t m, six_t x)
{
    const double x_2 = m.e[5] * x.e[5];
    const double t12 = 0.0 + m.e[0] * x.e[0] * x.e[0] + m.e[1] * x.e[1] * x.e[1] + m.e[2] * x.e[2] * x.e[2];
    const double total = t12 + m.e[3] * x.e[3] * x.e[3] + m.e[4] * x.e[4] * x.e[4] + x_2 * x.e[5];
    return total;
}

/* Return x'm x. */
static double form2(six_rows_t m, six_t x)
{
    return dot2(apply1(m, x), x);
}

/* ------------------------------- laws.predictive.horizon -------------------------------- */

/* Fly the policy of a sweep through the limits. */
static trial_t follow(double *numbers, six_t start)
{
    const motion_result_t motion_result = motion(numbers);
    const weights_t weights_2 = weights(numbers);
    const limits_t bounds = limits(numbers);
    bool cut_ = false;
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
        const vector_t v = vector_at(&numbers[PLAN_AT + 3 * k]);
        const vector_t row = vector_at(&numbers[STEP_AT + 3 * k]);
        const vector_t start_2 = add(v, row);
        const six_t row_2 = six_at(&numbers[FEEDBACK_AT + (6 * (3 * k))]);
        const six_t row_3 = six_at(&numbers[FEEDBACK_AT + (6 * (3 * k + 1))]);
        const six_t row_4 = six_at(&numbers[FEEDBACK_AT + (6 * (3 * k + 2))]);
        const project_result_t project_result = project(&bounds,
            (vector_t){dot3(row_2, (six_t){{x, x1, x2, x3, x4, x5}}, start_2.x),
            dot3(row_3, (six_t){{x, x1, x2, x3, x4, x5}}, start_2.y),
            dot3(row_4, (six_t){{x, x1, x2, x3, x4, x5}}, start_2.z)});
        const vector_t d = subtract(project_result.w, v);
        const six_t after = transition(motion_result.rows, motion_result.rows1,
            (six_t){{x, x1, x2, x3, x4, x5}}, d);
        put_vector(&numbers[TRIAL_AT + 3 * k], project_result.w);
        put_six(&numbers[BEND_AT + 6 * k], after);
        const vector_t row_5 = vector_at(&numbers[GRADIENT_AT + 3 * k]);
        const double t92 = form(weights_2.r, d) + form1(weights_2.q, (six_t){{x, x1, x2, x3, x4, x5}});
        cut_ = cut || project_result.truth;
        slope_ = slope + dot(row_5, d);
        change_ = change + t92;
        x_ = after.e[0];
        x1_ = after.e[1];
        x2_ = after.e[2];
        x3_ = after.e[3];
        x4_ = after.e[4];
        x5_ = after.e[5];
    }
    const double t96 = 0.5 * (change_ + form2(weights_2.p, (six_t){{x_, x1_, x2_, x3_, x4_, x5_}}));
    return (trial_t){.cut = cut_, .change = slope_ + t96};
}

/* -------------------------------- laws.predictive.solver -------------------------------- */

/* Fly the policy without limits through them: the optimum if nothing is cut, which it says, else a good
   start. */
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
    (void)sweep(numbers, 0.0);
    const six_t row = six_at(&numbers[STATES_AT]);
    const trial_t follow_2 = follow(numbers, row);
    for (int32_t k1 = 0; k1 < 10; k1++) {
        const vector_t row_2 = vector_at(&numbers[TRIAL_AT + 3 * k1]);
        put_vector(&numbers[PLAN_AT + 3 * k1], row_2);
    }
    return follow_2.cut;
}

/* ------------------------------- laws.predictive.horizon -------------------------------- */

/* Find the states under the plan, and half its cost. */
static double rollout(double *numbers)
{
    const motion_result_t motion_result = motion(numbers);
    const weights_t weights_2 = weights(numbers);
    const six_t row = six_at(&numbers[STATES_AT]);
    double cost_ = 0.0;
    double x_ = row.e[0];
    double x1_ = row.e[1];
    double x2_ = row.e[2];
    double x3_ = row.e[3];
    double x4_ = row.e[4];
    double x5_ = row.e[5];
    for (int32_t k = 0; k < 10; k++) {
        const double cost = cost_;
        const double x = x_;
        const double x1 = x1_;
        const double x2 = x2_;
        const double x3 = x3_;
        const double x4 = x4_;
        const double x5 = x5_;
        const vector_t v = vector_at(&numbers[PLAN_AT + 3 * k]);
        const six_t after = transition(motion_result.rows, motion_result.rows1,
            (six_t){{x, x1, x2, x3, x4, x5}}, v);
        put_six(&numbers[STATES_AT + 6 * k + 6], after);
        const double t29 = form1(weights_2.q, (six_t){{x, x1, x2, x3, x4, x5}}) + form(weights_2.r, v);
        cost_ = cost + t29;
        x_ = after.e[0];
        x1_ = after.e[1];
        x2_ = after.e[2];
        x3_ = after.e[3];
        x4_ = after.e[4];
        x5_ = after.e[5];
    }
    const double t32 = 0.5 * (cost_ + form2(weights_2.p, (six_t){{x_, x1_, x2_, x3_, x4_, x5_}}));
    return t32;
}

/* Return R v. */
static vector_t weighed(vector_t r, vector_t v)
{
    return (vector_t){r.x * v.x, r.y * v.y, r.z * v.z};
}

/* -------------------------------- laws.predictive.limits -------------------------------- */

/* Return the part of the gradient that no limit holds. */
static vector_t loose(const limits_t *limits, vector_t v, vector_t g)
{
    const bools3_t fixed = held(limits, v, g);
    return (vector_t){fixed.e[0] ? 0.0 : g.x, fixed.e[1] ? 0.0 : g.y, fixed.e[2] ? 0.0 : g.z};
}

/* ------------------------------- laws.predictive.horizon -------------------------------- */

/* Return Q x + A'y, summed up together. */
static six_t costate(six_t q, six_rows_t columns, six_t x, six_t y)
{
    const double t6 = 0.0 + (entry6(q) * x.e[0] + columns.e[0].e[0] * y.e[0]) + columns.e[0].e[1] * y.e[1];
    const double t12 = t6 + columns.e[0].e[2] * y.e[2] + columns.e[0].e[3] * y.e[3] + columns.e[0].e[4] *
        y.e[4];
    const double t20 = 0.0 + columns.e[1].e[0] * y.e[0] + (entry13(q) * x.e[1] + columns.e[1].e[1] * y.e[1]);
    const double t26 = t20 + columns.e[1].e[2] * y.e[2] + columns.e[1].e[3] * y.e[3] + columns.e[1].e[4] *
        y.e[4];
    const double t36 = 0.0 + columns.e[2].e[0] * y.e[0] + columns.e[2].e[1] * y.e[1] + (entry20(q) * x.e[2] +
        columns.e[2].e[2] * y.e[2]);
    const double t42 = t36 + columns.e[2].e[3] * y.e[3] + columns.e[2].e[4] * y.e[4] + columns.e[2].e[5] *
        y.e[5];
    const double t48 = 0.0 + columns.e[3].e[0] * y.e[0] + columns.e[3].e[1] * y.e[1] + columns.e[3].e[2] *
        y.e[2];
    const double t54 = t48 + (entry27(q) * x.e[3] + columns.e[3].e[3] * y.e[3]) + columns.e[3].e[4] * y.e[4];
    const double t62 = 0.0 + columns.e[4].e[0] * y.e[0] + columns.e[4].e[1] * y.e[1] + columns.e[4].e[2] *
        y.e[2];
    const double t68 = t62 + columns.e[4].e[3] * y.e[3] + (entry34(q) * x.e[4] + columns.e[4].e[4] * y.e[4]);
    const double t76 = 0.0 + columns.e[5].e[0] * y.e[0] + columns.e[5].e[1] * y.e[1] + columns.e[5].e[2] *
        y.e[2];
    const double term = entry41(q) * x.e[5] + columns.e[5].e[5] * y.e[5];
    const double total = t76 + columns.e[5].e[3] * y.e[3] + columns.e[5].e[4] * y.e[4] + term;
    return (six_t){{t12 + columns.e[0].e[5] * y.e[5], t26 + columns.e[1].e[5] * y.e[5], t42,
        t54 + columns.e[3].e[5] * y.e[5], t68 + columns.e[4].e[5] * y.e[5], total}};
}

/* Find the gradient of half the cost, and a bound on its gap to the optimum if all that is held has to be. */
static double adjoint(double *numbers)
{
    const motion_result_t motion_result = motion(numbers);
    const weights_t weight = weights(numbers);
    const limits_t bounds = limits(numbers);
    const six_rows_t columns = transposed(motion_result.rows);
    const sixs3_t pushes = transposed1(motion_result.rows1);
    const six_t row = six_at(&numbers[STATES_AT + 60]);
    const six_t apply1_2 = apply1(weight.p, row);
    double gap_ = 0.0;
    double y_ = apply1_2.e[0];
    double y1_ = apply1_2.e[1];
    double y2_ = apply1_2.e[2];
    double y3_ = apply1_2.e[3];
    double y4_ = apply1_2.e[4];
    double y5_ = apply1_2.e[5];
    for (int32_t back = 0; back < 10; back++) {
        const double gap = gap_;
        const double y = y_;
        const double y1 = y1_;
        const double y2 = y2_;
        const double y3 = y3_;
        const double y4 = y4_;
        const double y5 = y5_;
        const vector_t v = vector_at(&numbers[PLAN_AT + 3 * (9 - back)]);
        const six_t x = six_at(&numbers[STATES_AT + 6 * (9 - back)]);
        const vector_t weighed_2 = weighed(weight.r, v);
        const double dot3_2 = dot3(pushes.e[0], (six_t){{y, y1, y2, y3, y4, y5}}, weighed_2.x);
        const double dot3_3 = dot3(pushes.e[1], (six_t){{y, y1, y2, y3, y4, y5}}, weighed_2.y);
        const double dot3_4 = dot3(pushes.e[2], (six_t){{y, y1, y2, y3, y4, y5}}, weighed_2.z);
        const vector_t g = {dot3_2, dot3_3, dot3_4};
        put_vector(&numbers[GRADIENT_AT + 3 * (9 - back)], g);
        const six_t costate_2 = costate(weight.q, columns, x, (six_t){{y, y1, y2, y3, y4, y5}});
        gap_ = gap + form(weight.r_inverse, loose(&bounds, v, g));
        y_ = costate_2.e[0];
        y1_ = costate_2.e[1];
        y2_ = costate_2.e[2];
        y3_ = costate_2.e[3];
        y4_ = costate_2.e[4];
        y5_ = costate_2.e[5];
    }
    return 0.5 * gap_;
}

/* Turn the policy into a direction: step becomes the Newton step without limits. */
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
        const vector_t start = vector_at(&numbers[STEP_AT + 3 * k]);
        const six_t row = six_at(&numbers[FEEDBACK_AT + (6 * (3 * k))]);
        const double dot3_2 = dot3(row, (six_t){{x, x1, x2, x3, x4, x5}}, start.x);
        const six_t row_2 = six_at(&numbers[FEEDBACK_AT + (6 * (3 * k + 1))]);
        const double dot3_3 = dot3(row_2, (six_t){{x, x1, x2, x3, x4, x5}}, start.y);
        const six_t row_3 = six_at(&numbers[FEEDBACK_AT + (6 * (3 * k + 2))]);
        const double dot3_4 = dot3(row_3, (six_t){{x, x1, x2, x3, x4, x5}}, start.z);
        const vector_t d = {dot3_2, dot3_3, dot3_4};
        put_vector(&numbers[STEP_AT + 3 * k], d);
        const six_t transition_2 = transition(motion_result.rows, motion_result.rows1,
            (six_t){{x, x1, x2, x3, x4, x5}}, d);
        x_ = transition_2.e[0];
        x1_ = transition_2.e[1];
        x2_ = transition_2.e[2];
        x3_ = transition_2.e[3];
        x4_ = transition_2.e[4];
        x5_ = transition_2.e[5];
    }
}

/* -------------------------------- laws.predictive.solver -------------------------------- */

/* Search along the projection arc of the step (Armijo), halved so many times at most, until the cost falls
   enough. */
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
        const weights_t weights_2 = weights(numbers);
        const limits_t bounds = limits(numbers);
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
            const vector_t v = vector_at(&numbers[PLAN_AT + 3 * k]);
            const vector_t row = vector_at(&numbers[STEP_AT + 3 * k]);
            const project_result_t project_result = project(&bounds, add(v, scale(length, row)));
            const vector_t d = subtract(project_result.w, v);
            const six_t after = transition(motion_result.rows, motion_result.rows1,
                (six_t){{x, x1, x2, x3, x4, x5}}, d);
            put_vector(&numbers[TRIAL_AT + 3 * k], project_result.w);
            put_six(&numbers[BEND_AT + 6 * k], after);
            const vector_t row_2 = vector_at(&numbers[GRADIENT_AT + 3 * k]);
            const double t41 = form(weights_2.r, d) + form1(weights_2.q, (six_t){{x, x1, x2, x3, x4, x5}});
            slope_ = slope + dot(row_2, d);
            change1_ = change1 + t41;
            x_ = after.e[0];
            x1_ = after.e[1];
            x2_ = after.e[2];
            x3_ = after.e[3];
            x4_ = after.e[4];
            x5_ = after.e[5];
        }
        const double t45 = 0.5 * (change1_ + form2(weights_2.p, (six_t){{x_, x1_, x2_, x3_, x4_, x5_}}));
        const double t46 = slope_ + t45;
        const bool falls = slope_ < 0.0 && t46 <= 0.0001 * slope_;
        length_ = 0.5 * length;
        change_ = falls ? t46 : 0.0;
        left_ = left - 1.0;
    }
    return change_;
}

/* Return a trial plan along the Newton step without limits; gives the change of half the cost, zero where
   none was found. */
static double search(double *numbers)
{
    unroll(numbers);
    const double shorten_2 = shorten(numbers, 8.0);
    return shorten_2;
}

static bool is_zero(double x)
{
    return x <= 0.0 && 0.0 <= x;
}

/* Return a trial plan along the gradient, each move in its own scale: the projection guarantees descent
   for short steps. */
static double gradient_step(double *numbers)
{
    for (int32_t k = 0; k < 10; k++) {
        const double t2 = numbers[STIFFNESS_AT + k];
        const vector_t row = vector_at(&numbers[GRADIENT_AT + 3 * k]);
        const vector_t scale_2 = scale(-1.0 / t2, row);
        put_vector(&numbers[STEP_AT + 3 * k], scale_2);
    }
    const double shorten_2 = shorten(numbers, 60.0);
    return shorten_2;
}

/* ------------------------------- laws.predictive.horizon -------------------------------- */

/* Take the trial plan over. */
static void take_over(double *numbers)
{
    for (int32_t k = 0; k < 10; k++) {
        const vector_t row = vector_at(&numbers[TRIAL_AT + 3 * k]);
        put_vector(&numbers[PLAN_AT + 3 * k], row);
        const six_t row_2 = six_at(&numbers[STATES_AT + 6 * k + 6]);
        const six_t row_3 = six_at(&numbers[BEND_AT + 6 * k]);
        const six_t plus_2 = plus(row_2, row_3);
        put_six(&numbers[STATES_AT + 6 * k + 6], plus_2);
    }
}

/* -------------------------------- laws.predictive.solver -------------------------------- */

/* Return the projected Newton step, a search along it, or a gradient step, whichever first brings the cost
   down. */
static attempt_t newton(double *numbers, const progress_t *now)
{
    const sweep_result_t sweep_result = sweep(numbers, 0.0);
    const double sweeps = now->sweeps + 1.0;
    const trial_t trial = follow(numbers, (six_t){{0.0, 0.0, 0.0, 0.0, 0.0, 0.0}});
    const bool none_held = sweep_result.scalar1 <= 0.0;
    const bool free = !trial.cut;
    const double change_2 = free ? -(0.5 * sweep_result.scalar) : trial.change;
    const bool enough = free || change_2 <= -0.25 * sweep_result.scalar;
    double change_ = change_2;
    if (!enough) {
        const double search_2 = search(numbers);
        change_ = search_2;
    }
    const bool failed = !free && is_zero(change_);
    const bool hopeful = 1e-12 * now->half < sweep_result.scalar && sweeps < 50.0;
    const bool rescue = failed && (hopeful && !now->rescued);
    const bool t19 = !rescue;
    double change1_ = change_;
    if (failed && t19) {
        const double gradient_step_2 = gradient_step(numbers);
        change1_ = gradient_step_2;
    }
    const bool moves = free || !is_zero(change1_);
    const bool t24 = !moves;
    if (!t24) {
        take_over(numbers);
    }
    const double half = now->half + (moves ? change1_ : 0.0);
    const bool stuck = t24 && t19;
    const bool unshaped = free && none_held;
    const bool exact = free && (none_held || sweep_result.scalar <= 1e-16 * half);
    const bool solved = exact || (stuck && sweep_result.scalar <= 1e-12 * half);
    return (attempt_t){.progress = {.half = half, .sweeps = sweeps, .rescued = now->rescued,
        .over = exact || stuck, .solved = solved, .shaped = !unshaped}, .rescue = rescue};
}

/* ------------------------------- laws.predictive.interior ------------------------------- */

/* Put the plan aside, and start well inside. */
static void begin(double *numbers, double barrier)
{
    const limits_t bounds = limits(numbers);
    for (int32_t k = 0; k < 10; k++) {
        const vector_t v = vector_at(&numbers[PLAN_AT + 3 * k]);
        put_vector(&numbers[SPARE_AT + 3 * k], v);
        const vector_t w = add(bounds.centre, scale(0.9, subtract(v, bounds.centre)));
        put_vector(&numbers[PLAN_AT + 3 * k], w);
        const vector_t slack_2 = slack(&bounds, w);
        numbers[MULTIPLIERS_AT + 3 * k] = barrier / slack_2.x;
        numbers[MULTIPLIERS_AT + 3 * k + 1] = barrier / slack_2.y;
        numbers[MULTIPLIERS_AT + 3 * k + 2] = barrier / slack_2.z;
    }
}

/* Return for a ball the sum, thrice. */
static vector_t joined(vector_t x)
{
    return x;
}

/* Return the share of the step that keeps slacks and multipliers positive; steps of the multipliers go to
   `trial`. */
static double length_1(double *numbers, double barrier)
{
    const limits_t bounds = limits(numbers);
    double length_ = 1.0;
    for (int32_t k = 0; k < 10; k++) {
        const double length = length_;
        const vector_t v = vector_at(&numbers[PLAN_AT + 3 * k]);
        const vector_t d = vector_at(&numbers[STEP_AT + 3 * k]);
        const vector_t room = slack(&bounds, v);
        const vector_t away = subtract(v, bounds.centre);
        const vector_t inner = joined(times(away, d));
        const vector_t square = joined(times(d, d));
        const double old = numbers[MULTIPLIERS_AT + 3 * k];
        const double step_2 = barrier / room.x - old + old / room.x * inner.x;
        numbers[TRIAL_AT + 3 * k] = step_2;
        const double length_2 = step_2 < 0.0 ? minimum(-0.95 * old / step_2, length) : length;
        const double ahead = inner.x + sqrt(inner.x * inner.x + 2.0 * room.x * square.x);
        const double length_3 = 0.0 < ahead ? minimum(1.9 * room.x / ahead, length_2) : length_2;
        const double old_2 = numbers[MULTIPLIERS_AT + 3 * k + 1];
        const double step_3 = barrier / room.y - old_2 + old_2 / room.y * inner.y;
        numbers[TRIAL_AT + 3 * k + 1] = step_3;
        const double length_4 = step_3 < 0.0 ? minimum(-0.95 * old_2 / step_3, length_3) : length_3;
        const double ahead_2 = inner.y + sqrt(inner.y * inner.y + 2.0 * room.y * square.y);
        const double length_5 = 0.0 < ahead_2 ? minimum(1.9 * room.y / ahead_2, length_4) : length_4;
        const double old_3 = numbers[MULTIPLIERS_AT + 3 * k + 2];
        const double step_4 = barrier / room.z - old_3 + old_3 / room.z * inner.z;
        numbers[TRIAL_AT + 3 * k + 2] = step_4;
        const double length_6 = step_4 < 0.0 ? minimum(-0.95 * old_3 / step_4, length_5) : length_5;
        const double ahead_3 = inner.z + sqrt(inner.z * inner.z + 2.0 * room.z * square.z);
        const double shorter = minimum(1.9 * room.z / ahead_3, length_6);
        length_ = 0.0 < ahead_3 ? shorter : length_6;
    }
    return length_;
}

/* Take the step at that length; gives the sum of slack times multiplier. */
static double go(double *numbers, double length)
{
    const limits_t bounds = limits(numbers);
    double gap_ = 0.0;
    for (int32_t k = 0; k < 10; k++) {
        const double gap = gap_;
        const vector_t row = vector_at(&numbers[PLAN_AT + 3 * k]);
        const vector_t row_2 = vector_at(&numbers[STEP_AT + 3 * k]);
        const vector_t w = add(row, scale(length, row_2));
        put_vector(&numbers[PLAN_AT + 3 * k], w);
        const vector_t room = slack(&bounds, w);
        const double t17 = numbers[MULTIPLIERS_AT + 3 * k];
        const double t19 = numbers[TRIAL_AT + 3 * k];
        const double multiplier = t17 + length * t19;
        numbers[MULTIPLIERS_AT + 3 * k] = multiplier;
        const double t25 = numbers[MULTIPLIERS_AT + 3 * k + 1];
        const double t27 = numbers[TRIAL_AT + 3 * k + 1];
        const double multiplier_2 = t25 + length * t27;
        numbers[MULTIPLIERS_AT + 3 * k + 1] = multiplier_2;
        const double t33 = numbers[MULTIPLIERS_AT + 3 * k + 2];
        const double t35 = numbers[TRIAL_AT + 3 * k + 2];
        const double multiplier_3 = t33 + length * t35;
        numbers[MULTIPLIERS_AT + 3 * k + 2] = multiplier_3;
        const double t39 = gap + multiplier * room.x + multiplier_2 * room.y + multiplier_3 * room.z;
        gap_ = t39;
    }
    return gap_;
}

/* Take one step: towards the optimum that the barrier allows, which is then lowered. */
static turn_t turn_1(double *numbers, const turn_t *now, double count, double most)
{
    (void)adjoint(numbers);
    (void)sweep(numbers, now->barrier);
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

/* Put moves near a limit on it. */
static void settle(double *numbers)
{
    const limits_t bounds = limits(numbers);
    const double near = 1e-05 * bounds.bound * bounds.bound;
    for (int32_t k = 0; k < 10; k++) {
        const vector_t v = vector_at(&numbers[PLAN_AT + 3 * k]);
        const vector_t room = slack(&bounds, v);
        const vector_t b = subtract(v, bounds.centre);
        const vector_t add_2 = add(bounds.centre, (vector_t){(room.x < near ? 2.0 : 1.0) * b.x,
            (room.y < near ? 2.0 : 1.0) * b.y, (room.z < near ? 2.0 : 1.0) * b.z});
        const project_result_t project_result = project(&bounds, add_2);
        put_vector(&numbers[PLAN_AT + 3 * k], project_result.w);
    }
}

/* Take back the plan put aside; gives half its cost. */
static double restore(double *numbers)
{
    for (int32_t k = 0; k < 10; k++) {
        const vector_t row = vector_at(&numbers[SPARE_AT + 3 * k]);
        put_vector(&numbers[PLAN_AT + 3 * k], row);
    }
    const double rollout_2 = rollout(numbers);
    return rollout_2;
}

/* Solve by the primal-dual interior-point method (Boyd and Vandenberghe 2004, section 11.7): it comes near
   the optimum in a number of sweeps that hardly depends on the program, and what then lies near a limit is
   put on it. */
static interior_result_t interior(double *numbers, double half, double most)
{
    const double barrier_2 = 0.1 * half / 30.0;
    begin(numbers, barrier_2);
    (void)rollout(numbers);
    double barrier_ = barrier_2;
    double sweeps_ = 0.0;
    bool done_ = most <= 0.0;
    for (int32_t turn = 0; turn < 30; turn++) {
        const double barrier = barrier_;
        const double sweeps = sweeps_;
        const bool done = done_;
        if (done) break;
        const turn_t now = {.barrier = barrier, .sweeps = sweeps, .done = done};
        const turn_t turn_1_2 = turn_1(numbers, &now, 30.0, most);
        barrier_ = turn_1_2.barrier;
        sweeps_ = turn_1_2.sweeps;
        done_ = turn_1_2.done;
    }
    settle(numbers);
    const double reached = rollout(numbers);
    double half1_ = reached;
    if (!(reached <= half)) {
        const double restore_2 = restore(numbers);
        half1_ = restore_2;
    }
    return (interior_result_t){.scalar = sweeps_, .kept = half1_};
}

/* -------------------------------- laws.predictive.solver -------------------------------- */

/* Return A Newton step, or the interior-point method where that does not serve. */
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
        const attempt_t newton_2 = newton(numbers, now);
        half_ = newton_2.progress.half;
        sweeps_ = newton_2.progress.sweeps;
        rescued_ = newton_2.progress.rescued;
        over_ = newton_2.progress.over;
        solved_ = newton_2.progress.solved;
        shaped_ = newton_2.progress.shaped;
        rescue_ = newton_2.rescue;
    }
    double half1_ = half_;
    double sweeps1_ = sweeps_;
    bool rescued1_ = rescued_;
    if (rescue_) {
        const interior_result_t interior_result = interior(numbers, half_, 50.0 - sweeps_);
        half1_ = interior_result.kept;
        sweeps1_ = sweeps_ + interior_result.scalar;
        rescued1_ = true;
    }
    return (progress_t){.half = half1_, .sweeps = sweeps1_, .rescued = rescued1_, .over = over_,
        .solved = solved_, .shaped = shaped_};
}

/* End the run or improve the plan in one turn. */
static progress_t turn1_1(double *numbers, const progress_t *now)
{
    const double adjoint_2 = adjoint(numbers);
    const bool optimal = adjoint_2 <= 1e-16 * now->half;
    const bool used_up = 50.0 <= now->sweeps;
    double half_ = now->half;
    double sweeps_ = now->sweeps;
    bool rescued_ = now->rescued;
    bool over_ = true;
    bool solved_ = optimal;
    bool shaped_ = now->shaped;
    if (!(optimal || used_up)) {
        const progress_t better_2 = better(numbers, now);
        half_ = better_2.half;
        sweeps_ = better_2.sweeps;
        rescued_ = better_2.rescued;
        over_ = better_2.over;
        solved_ = better_2.solved;
        shaped_ = better_2.shaped;
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

/* Improve the plan until it is the optimum or the sweeps are used up. */
static solved_t descend(double *numbers, double sweeps)
{
    const double rollout_2 = rollout(numbers);
    double half_ = rollout_2;
    double sweeps1_ = sweeps;
    bool rescued_ = false;
    bool over_ = false;
    bool solved_ = false;
    bool shaped_ = true;
    for (int32_t turn = 0; turn < 51; turn++) {
        const double half = half_;
        const double sweeps1 = sweeps1_;
        const bool rescued = rescued_;
        const bool over = over_;
        const bool solved = solved_;
        const bool shaped = shaped_;
        if (over) break;
        const progress_t now = {.half = half, .sweeps = sweeps1, .rescued = rescued, .over = over,
            .solved = solved, .shaped = shaped};
        const progress_t turn1_1_2 = turn1_1(numbers, &now);
        half_ = turn1_1_2.half;
        sweeps1_ = turn1_1_2.sweeps;
        rescued_ = turn1_1_2.rescued;
        over_ = turn1_1_2.over;
        solved_ = turn1_1_2.solved;
        shaped_ = turn1_1_2.shaped;
    }
    return (solved_t){.sweeps = sweeps1_, .solved = solved_, .shaped = shaped_ && is_finite(half_)};
}

/* Solve the program from the first of its states, starting with its plan if warm; the plan is overwritten. */
static solved_t improve(double *numbers, bool warm)
{
    double sweeps_ = 0.0;
    bool cut_ = true;
    if (!warm) {
        const bool fly_freely_2 = fly_freely(numbers);
        sweeps_ = 1.0;
        cut_ = fly_freely_2;
    }
    double sweeps1_ = sweeps_;
    bool solved_ = true;
    bool shaped_ = false;
    if (cut_) {
        const solved_t descend_2 = descend(numbers, sweeps_);
        sweeps1_ = descend_2.sweeps;
        solved_ = descend_2.solved;
        shaped_ = descend_2.shaped;
    }
    return (solved_t){.sweeps = sweeps1_, .solved = solved_, .shaped = shaped_};
}

/* --------------------------------------- laws.mpc --------------------------------------- */

/* Bring the counters up to date. */
static void count_1(double *numbers, const solved_t *end)
{
    const vector_t row = vector_at(&numbers[COUNTERS_AT]);
    const double t4 = numbers[COUNTERS_AT + 3];
    numbers[COUNTERS_AT] = row.x + 1.0;
    numbers[COUNTERS_AT + 1] = row.y + end->sweeps;
    numbers[COUNTERS_AT + 2] = maximum(row.z, end->sweeps);
    numbers[COUNTERS_AT + 3] = t4 + (end->solved ? 0.0 : 1.0);
    numbers[COUNTERS_AT + 4] = end->shaped ? 1.0 : 0.0;
}

/* -------------------------------- laws.predictive.sixes --------------------------------- */

/* Return the k-th three numbers of a buffer. */
static vector_t triple1(double *numbers)
{
    const vector_t row = vector_at(&numbers[PLAN_AT]);
    return row;
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

/* Return the control torque (N m, body): the first move of the best plan. */
static vector_t mpc_torque(double *numbers, const measurement_t *measurement, const craft_t *craft)
{
    const vector_t ahead = tracking_torque(measurement, craft);
    const linear_t linearise_2 = linearise(measurement, craft);
    sample(numbers, &linearise_2, measurement->period);
    put_limits(numbers, scale(-1.0, ahead), craft->torque_limit);
    const double t1 = numbers[COUNTERS_AT + 4];
    const bool warm = 0.0 < t1;
    if (warm) {
        advance(numbers);
    }
    const vector_t vector_part_2 = vector_part(measurement->attitude);
    numbers[STATES_AT] = vector_part_2.x;
    numbers[STATES_AT + 1] = vector_part_2.y;
    numbers[STATES_AT + 2] = vector_part_2.z;
    numbers[STATES_AT + 3] = measurement->rate.x;
    numbers[STATES_AT + 4] = measurement->rate.y;
    numbers[STATES_AT + 5] = measurement->rate.z;
    const solved_t improve_2 = improve(numbers, warm);
    count_1(numbers, &improve_2);
    const vector_t triple1_2 = triple1(numbers);
    const vector_t command = add(triple1_2, ahead);
    return clip_axes(command, craft->torque_limit);
}

/* -------------------------------- parts.actuators.limits -------------------------------- */

/* Each component within +-limit, as wheels or thruster pairs along the axes give. */
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
    const goal_t goal = inertial_goal(&parameters.setup.target);
    const state_t body_state = {.attitude = input->attitude, .rate = input->rate,
        .position = input->position};
    const scene_t scene = {.goal = goal, .period = parameters.setup.period};
    const measurement_t told = observe(&body_state, &scene);
    const as_published_result_t as_published_result = as_published(told.attitude);
    const measurement_t told_2 = {.attitude = as_published_result.attitude, .rate = told.rate,
        .body_rate = told.body_rate, .target_acceleration = told.target_acceleration,
        .position = told.position, .period = told.period};
    const vector_t wanted = mpc_torque(numbers, &told_2, &parameters.craft);
    command->torque = limit_axis(wanted, parameters.setup.limit);
}
