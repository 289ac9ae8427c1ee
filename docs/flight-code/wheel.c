/* wheel.c: made by starhold 0.3.0; see wheel.h. Do not edit: change the scenario and export it again. */

#include "wheel.h"

#include <math.h>
#include <stdbool.h>

#if defined(__FAST_MATH__) || (defined(__FLT_EVAL_METHOD__) && __FLT_EVAL_METHOD__ != 0)
#error "this code needs IEEE arithmetic in doubles: no -ffast-math, no x87"
#endif
#if !defined(__GNUC__) || defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif

typedef wheel_quaternion_t quaternion_t;
typedef wheel_vector_t vector_t;
typedef wheel_doubles4_t doubles4_t;
typedef wheel_wheels_state_t wheels_state_t;

/* Rows of a 3x3 matrix. */
typedef struct {
    vector_t row[3];
} matrix_t;

/* Damping, stiffness, and the share of the modelled torque that is compensated. */
typedef struct {
    double k_rate; /* N m s: damping */
    vector_t k_attitude; /* N m: weights of 1 - a_ii: one, or one per axis */
    double compensation; /* share of the gyroscopic, target and external torque compensated */
} gains_t;

/* A rigid spacecraft. */
typedef struct {
    vector_t inertia; /* kg m^2: of a craft with wheels without their rotors' about their axes */
    double gravity; /* m^3/s^2: gravitational parameter of the body that it orbits */
    vector_t with_rotors; /* kg m^2: inertia with the rotors; () without wheels */
} craft_t;

typedef struct {
    vector_t e[4];
} vectors4_t;

/* N wheels: unit spin axes (body), rotor inertias about them (kg m2), largest motor torques (N m; 0 for a
   lost wheel), largest axial momenta (N m s), viscous (N m s) and Coulomb friction (N m); and how a torque
   is allocated, by least squares (a row for each wheel, zero for one that takes no part) or with the least
   peak, which needs `with_facets`. */
typedef struct {
    vectors4_t axes;
} wheels_t;

typedef struct {
    wheels_t wheels;
} effectors_t;

/* The numbers of a loop besides those of craft and law, an argument of kernels. */
typedef struct {
    effectors_t effectors;
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
    vector_t velocity;
} state_t;

/* The target attitude q_RN (inertial to target axes), and the target's angular velocity (rad/s) and
   acceleration (rad/s2), both in target axes. */
typedef struct {
    quaternion_t attitude;
    vector_t rate;
    vector_t acceleration;
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
        .k_rate = 0.7338343309438073, /* N m s */
        .k_attitude = {0.011572066137231305, 0.011572066137231305, 0.011572066137231305}, /* N m */
        .compensation = 1.0,
    },
    .craft = {
        .inertia = {5.998666666666667, 7.998666666666667, 4.998666666666667}, /* kg m^2 */
        .gravity = 398600000000000.0, /* m^3/s^2 */
        .with_rotors = {6.0, 8.0, 5.0}, /* kg m^2 */
    },
    .setup = {
        .effectors = {
            .wheels = {
                .axes = {{{0.5773502691896258, 0.5773502691896258, 0.5773502691896258}, {-0.5773502691896258, 0.5773502691896258, 0.5773502691896258}, {-0.5773502691896258, -0.5773502691896258, 0.5773502691896258}, {0.5773502691896258, -0.5773502691896258, 0.5773502691896258}}},
            },
        },
    },
};


/* ------------------------------------ algebra.vector ------------------------------------ */

/* Return the vector product. */
static vector_t cross(vector_t a, vector_t b)
{
    return (vector_t){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/* Return the scalar product. */
static double dot(vector_t a, vector_t b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

/* Return c a. */
static vector_t scale(double c, vector_t a)
{
    return (vector_t){c * a.x, c * a.y, c * a.z};
}

/* ----------------------------------- algebra.cosines ------------------------------------ */

static quaternion_t choose(bool condition, quaternion_t a, quaternion_t b)
{
    return (quaternion_t){condition ? a.q0 : b.q0, condition ? a.q1 : b.q1, condition ? a.q2 : b.q2,
        condition ? a.q3 : b.q3};
}

/* ---------------------------------- algebra.quaternion ---------------------------------- */

/* Return c q. */
static quaternion_t stretch(double c, quaternion_t q)
{
    return (quaternion_t){c * q.q0, c * q.q1, c * q.q2, c * q.q3};
}

/* Return q / |q|; not defined at zero. */
static quaternion_t normalise(quaternion_t q)
{
    return stretch(1.0 / sqrt(q.q0 * q.q0 + q.q1 * q.q1 + q.q2 * q.q2 + q.q3 * q.q3), q);
}

/* ----------------------------------- algebra.cosines ------------------------------------ */

/* Return the quaternion of a rotation matrix, from the largest of its four squared components (Shepperd's
   method). */
static quaternion_t to_quaternion(matrix_t a)
{
    const double trace = a.row[0].x + a.row[1].y + a.row[2].z;
    const double x = a.row[1].z - a.row[2].y;
    const double y = a.row[2].x - a.row[0].z;
    const double z = a.row[0].y - a.row[1].x;
    const double xy = a.row[0].y + a.row[1].x;
    const double yz = a.row[1].z + a.row[2].y;
    const double zx = a.row[2].x + a.row[0].z;
    const double t9 = 1.0 + trace;
    const double t12 = 1.0 + 2.0 * a.row[0].x - trace;
    const double t15 = 1.0 + 2.0 * a.row[1].y - trace;
    const double t18 = 1.0 + 2.0 * a.row[2].z - trace;
    const bool t19 = t9 < t12;
    const quaternion_t first = {x, t12, xy, zx};
    const quaternion_t scalar = {t9, x, y, z};
    const double size = t19 ? t12 : t9;
    const bool t23 = size < t15;
    const quaternion_t second = {y, xy, t15, yz};
    const quaternion_t largest = choose(t23, second, choose(t19, first, scalar));
    const double size_2 = t23 ? t15 : size;
    const quaternion_t third = {z, zx, yz, t18};
    return normalise(choose(size_2 < t18, third, largest));
}

/* ------------------------------------ algebra.scalar ------------------------------------ */

/* Return -1 for negative x, else +1: a sign that is never zero. */
static double side(double x)
{
    return x < 0.0 ? -1.0 : 1.0;
}

/* ---------------------------------- algebra.quaternion ---------------------------------- */

/* Return whichever of q and -q, the same attitude, is nearer to `other`. */
static quaternion_t nearer(quaternion_t q, quaternion_t other)
{
    return stretch(side(q.q0 * other.q0 + q.q1 * other.q1 + q.q2 * other.q2 + q.q3 * other.q3), q);
}

/* -------------------------------- parts.targets.orbital --------------------------------- */

/* Return the frame at this position and velocity. */
static goal_t orbital_goal(const state_t *state, quaternion_t before)
{
    const vector_t h = cross(state->position, state->velocity);
    const double r2_2 = dot(state->position, state->position);
    const double h2 = dot(h, h);
    const double size = sqrt(h2);
    const vector_t down = scale(-1.0 / sqrt(r2_2), state->position);
    const vector_t against = scale(-1.0 / size, h);
    const quaternion_t attitude = nearer(to_quaternion((matrix_t){{cross(against, down), against, down}}),
        before);
    const double rate = size / r2_2;
    return (goal_t){.attitude = attitude, .rate = {0.0, -rate, 0.0}, .acceleration = {0.0,
        2.0 * rate * dot(state->position, state->velocity) / r2_2, 0.0}};
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
    return craft->with_rotors;
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

/* ----------------------------------- algebra.several ------------------------------------ */

/* Return the sum of weights[i] * vectors[i], added from the first to the last; there is at least one. */
static vector_t weighted(doubles4_t weights, vectors4_t vectors)
{
    const double t11 = weights.e[0] * vectors.e[0].x + weights.e[1] * vectors.e[1].x + weights.e[2] *
        vectors.e[2].x;
    const double t13 = weights.e[0] * vectors.e[0].y + weights.e[1] * vectors.e[1].y + weights.e[2] *
        vectors.e[2].y;
    const double t15 = weights.e[0] * vectors.e[0].z + weights.e[1] * vectors.e[1].z + weights.e[2] *
        vectors.e[2].z;
    const double x = t11 + weights.e[3] * vectors.e[3].x;
    const double y = t13 + weights.e[3] * vectors.e[3].y;
    const double z = t15 + weights.e[3] * vectors.e[3].z;
    return (vector_t){x, y, z};
}

/* -------------------------------- parts.effectors.wheels -------------------------------- */

/* Return the wheels' momentum in body axes (N m s): sum a_i h_i. */
static vector_t wheel_momentum(doubles4_t momentum, const wheels_t *wheels)
{
    return weighted(momentum, wheels->axes);
}

/* Return this momentum as measured by tachometers, with the assumed axes (N m s). */
static vector_t measured_momentum(const wheels_state_t *state, const wheels_t *params)
{
    return wheel_momentum(state->momentum, params);
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

/* ------------------------------------ algebra.vector ------------------------------------ */

/* Return a - b. */
static vector_t subtract(vector_t a, vector_t b)
{
    return (vector_t){a.x - b.x, a.y - b.y, a.z - b.z};
}

/* ------------------------------- parts.bodies.rigid_body -------------------------------- */

/* Return the law's measurement of a state from sensors or estimators. */
static measurement_t observe(const state_t *state, const scene_t *scene)
{
    const quaternion_t error = relative(scene->goal.attitude, state->attitude);
    const vector_t target_rate = to_body(error, scene->goal.rate);
    const vector_t error_rate = subtract(state->rate, target_rate);
    const vector_t target_acceleration = subtract(to_body(error, scene->goal.acceleration),
        cross(error_rate, target_rate));
    return (measurement_t){.attitude = error, .rate = error_rate, .body_rate = state->rate,
        .target_acceleration = target_acceleration, .external_torque = scene->torque,
        .wheel_momentum = scene->momentum};
}

/* -------------------------------------- laws.wheel -------------------------------------- */

/* Return M q with M = tr(k) - diag(k): sum k_i (1 - a_ii) = 2 q.Mq. */
static vector_t twist(vector_t k, vector_t q)
{
    return (vector_t){(k.y + k.z) * q.x, (k.z + k.x) * q.y, (k.x + k.y) * q.z};
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

/* -------------------------------------- laws.wheel -------------------------------------- */

/* Return the torque demanded of the wheels (N m, body axes). */
static vector_t wheel_torque(const measurement_t *measurement, const gains_t *gains, const craft_t *craft)
{
    const vector_t q = vector_part(measurement->attitude);
    const vector_t twist_2 = twist(gains->k_attitude, q);
    const vector_t cosines = scale(2.0, add(scale(measurement->attitude.q0, twist_2), cross(twist_2, q)));
    const vector_t feedback = add(scale(gains->k_rate, measurement->rate), cosines);
    const vector_t momentum = add(apply(craft->inertia, measurement->body_rate), measurement->wheel_momentum);
    const vector_t model = subtract(add(cross(measurement->body_rate, momentum),
        apply(craft->inertia, measurement->target_acceleration)), measurement->external_torque);
    return subtract(scale(gains->compensation, model), feedback);
}

/* -------------------------------------- interface --------------------------------------- */

void wheel_init(wheel_state_t *state)
{
    state->followed = (quaternion_t){0.7055202438209324, 0.047341161359353054, -0.7055202438209324, -0.047341161359353054};
}

void wheel_step(wheel_state_t *state, const wheel_input_t *input, wheel_command_t *command)
{
    const state_t body_state = {.attitude = input->attitude, .rate = input->rate, .position = input->position,
        .velocity = input->velocity};
    const goal_t goal = orbital_goal(&body_state, state->followed);
    const scene_t scene = {.goal = goal, .torque = gravity_gradient_torque(&body_state, &parameters.craft),
        .momentum = measured_momentum(&input->wheels, &parameters.setup.effectors.wheels)};
    const measurement_t measurement = observe(&body_state, &scene);
    const quaternion_t followed = goal.attitude;
    command->torque = wheel_torque(&measurement, &parameters.gains, &parameters.craft);
    state->followed = followed;
}
