/* A quadrotor as an FMU, by the laws of volery.simulation.world.dynamics and the figures of its usual body.
 *
 * FMI_VERSION is 2 (scalars: the value reference is the place in `values`) or 3 (arrays: it is the place of
 * the first value). Axes are forward, left, up; with FRD forward, right, down. The order of `values` is that
 * of QUANTITIES in multirotor_fmu.py.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#if FMI_VERSION == 2
#include "fmi2Functions.h"
#else
#include "fmi3Functions.h"
#endif

enum {
    COMMANDS = 0, WIND = 4, GROUND = 7, VOLTAGE = 8, LOAD = 9, PUSH = 10, POSITION = 13, VELOCITY = 16,
    ATTITUDE = 19, RATES = 23, ROTOR_SPEEDS = 26, FAIL_AT = 30, FAILURE = 31, VALUES = 32
};
enum { NONE, CRASH, ERROR, NO_NUMBER, HANG, FALL, DISCARD };

static const double MASS = 3.0, GRAVITY = 9.80665, STEP = 0.002, THRUST = 4.0e-5, TOP = 760.0, FULL = 12.6;
static const double LAG = 0.04, DRAG_LINEAR = 0.73, DRAG_QUADRATIC = 0.10, SPIN_DAMPING = 0.004;
static const double INERTIA[3] = {0.040, 0.040, 0.089}, FEET[3] = {0.15, 0.15, 0.12}, FRICTION = 0.6;
static const double SPIN[4] = {-1, -1, 1, 1};
static const double ARM = 0.25 * 0.70710678118654752;

typedef struct {
    double position[3], velocity[3], q[4], rates[3];
} Motion;

typedef struct {
    double values[VALUES], time, rotors[4], torque_coefficient, inflow;
    Motion motion;
    int resting;
} Quadrotor;

static Quadrotor *create(void) {
    Quadrotor *quad = calloc(1, sizeof *quad);
    double disc = M_PI * 0.35 * 0.35 / 4.0, hover = sqrt(MASS * GRAVITY / (4.0 * THRUST));
    quad->torque_coefficient = THRUST * sqrt(THRUST) / (0.6 * sqrt(2.0 * 1.225 * disc));
    double jet = 2.0 * (4.0 * quad->torque_coefficient * hover * hover * hover / 0.8 + 3.0) / (MASS * GRAVITY);
    quad->inflow = MASS * GRAVITY / (jet * jet);
    quad->motion.q[0] = 1.0;
    quad->motion.position[2] = FEET[2] - 0.005;
    quad->resting = 1;
    quad->values[FAIL_AT] = 1e9;
    return quad;
}

static double axis(int index, double value) {
#ifdef FRD
    return index == 0 ? value : -value;
#else
    return value;
#endif
}

static void give(Quadrotor *quad) {
    for (int i = 0; i < 3; i++) {
        quad->values[POSITION + i] = axis(i, quad->motion.position[i]);
        quad->values[VELOCITY + i] = axis(i, quad->motion.velocity[i]);
        quad->values[ATTITUDE + 1 + i] = axis(i, quad->motion.q[1 + i]);
        quad->values[RATES + i] = axis(i, quad->motion.rates[i]);
    }
    quad->values[ATTITUDE] = quad->motion.q[0];
    memcpy(quad->values + ROTOR_SPEEDS, quad->rotors, sizeof quad->rotors);
}

static void matrix(const double *q, double r[3][3]) {
    double w = q[0], x = q[1], y = q[2], z = q[3];
    double rows[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
                         {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
                         {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}};
    memcpy(r, rows, sizeof rows);
}

static void touch(const Quadrotor *quad, const Motion *m, double r[3][3], double ground, double mass,
                  double *force, double *torque) {
    double stiffness = MASS * GRAVITY / 4.0 / 0.005, damping = sqrt(MASS * stiffness) * 0.8;
    for (int foot = 0; foot < 4; foot++) {
        double at[3] = {foot < 2 ? FEET[0] : -FEET[0], foot % 2 ? -FEET[1] : FEET[1],
                        r[2][2] >= 0 ? -FEET[2] : FEET[2]};
        double depth = ground - m->position[2] - (r[2][0] * at[0] + r[2][1] * at[1] + r[2][2] * at[2]);
        if (depth <= 0.0) continue;
        const double *w = m->rates;
        double turn[3] = {w[1] * at[2] - w[2] * at[1], w[2] * at[0] - w[0] * at[2], w[0] * at[1] - w[1] * at[0]};
        double v[3], f[3], body[3];
        for (int i = 0; i < 3; i++)
            v[i] = m->velocity[i] + r[i][0] * turn[0] + r[i][1] * turn[1] + r[i][2] * turn[2];
        f[2] = fmax(0.0, stiffness * depth - damping * (v[2] > 0 ? 3.0 : 1.0) * v[2]);
        double grip = FRICTION * f[2] / fmax(sqrt(v[0] * v[0] + v[1] * v[1]), 0.05);
        grip = fmin(grip, mass / (4.0 * STEP));
        f[0] = -grip * v[0];
        f[1] = -grip * v[1];
        for (int i = 0; i < 3; i++) {
            force[i] += f[i];
            body[i] = r[0][i] * f[0] + r[1][i] * f[1] + r[2][i] * f[2];
        }
        torque[0] += at[1] * body[2] - at[2] * body[1];
        torque[1] += at[2] * body[0] - at[0] * body[2];
        torque[2] += at[0] * body[1] - at[1] * body[0];
    }
}

static Motion slope(const Quadrotor *quad, const Motion *m, const double *rotors) {
    double r[3][3], force[3], torque[3] = {0}, air[3], lift = 0, turning = 0, along = 0, square = 0;
    const double *in = quad->values;
    double mass = MASS + in[LOAD];
    matrix(m->q, r);
    for (int i = 0; i < 4; i++) {
        double x = i == 0 || i == 2 ? ARM : -ARM, y = i == 1 || i == 2 ? ARM : -ARM;
        double thrust = THRUST * rotors[i] * rotors[i];
        turning += rotors[i];
        lift += thrust;
        torque[0] += y * thrust;
        torque[1] -= x * thrust;
        torque[2] += SPIN[i] * quad->torque_coefficient * rotors[i] * rotors[i];
    }
    for (int i = 0; i < 3; i++) {
        air[i] = m->velocity[i] - axis(i, in[WIND + i]);
        along += air[i] * r[i][2];
        square += air[i] * air[i];
    }
    double plane = sqrt(fmax(0.0, square - along * along));
    double hover = sqrt(MASS * GRAVITY / (4.0 * THRUST));
    double drag = DRAG_LINEAR * turning / (4.0 * hover) + DRAG_QUADRATIC * plane;
    lift -= DRAG_QUADRATIC * (fabs(along) - plane) * along;
    if (along > 0.0) lift -= quad->inflow * along * along;
    for (int i = 0; i < 3; i++) {
        force[i] = r[i][2] * lift - drag * air[i];
        for (int k = 0; k < 3; k++) force[i] += r[i][k] * axis(k, in[PUSH + k]);
        torque[i] -= SPIN_DAMPING * m->rates[i];
    }
    if (in[FAILURE] != FALL) touch(quad, m, r, axis(2, in[GROUND]), mass, force, torque);
    Motion d;
    const double *q = m->q, *w = m->rates;
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        d.position[i] = m->velocity[i];
        d.velocity[i] = force[i] / mass - (i == 2 ? GRAVITY : 0.0);
        d.rates[i] = (torque[i] + (INERTIA[j] - INERTIA[k]) * w[j] * w[k]) / INERTIA[i];
    }
    d.q[0] = 0.5 * (-q[1] * w[0] - q[2] * w[1] - q[3] * w[2]);
    d.q[1] = 0.5 * (q[0] * w[0] + q[2] * w[2] - q[3] * w[1]);
    d.q[2] = 0.5 * (q[0] * w[1] - q[1] * w[2] + q[3] * w[0]);
    d.q[3] = 0.5 * (q[0] * w[2] + q[1] * w[1] - q[2] * w[0]);
    return d;
}

static void add(Motion *to, const Motion *from, const Motion *d, double h) {
    double *out = (double *)to;
    const double *base = (const double *)from, *rate = (const double *)d;
    for (size_t i = 0; i < sizeof(Motion) / sizeof(double); i++) out[i] = base[i] + h * rate[i];
}

static void turn_rotors(const Quadrotor *quad, const double *from, double *to) {
    double decay = exp(-0.5 * STEP / LAG);
    for (int i = 0; i < 4; i++) {
        double target = quad->values[COMMANDS + i] * TOP * quad->values[VOLTAGE] / FULL;
        to[i] = target + decay * (from[i] - target);
    }
}

static void rest(Quadrotor *quad, const double *before) {
    double r[3][3], thrust = 0, speed = 0, spin = 0;
    matrix(quad->motion.q, r);
    for (int i = 0; i < 4; i++) thrust += THRUST * quad->rotors[i] * quad->rotors[i];
    double lowest = FEET[0] * fabs(r[2][0]) + FEET[1] * fabs(r[2][1]) + FEET[2] * fabs(r[2][2]);
    int touching = quad->motion.position[2] - lowest < axis(2, quad->values[GROUND]);
    for (int i = 0; i < 3; i++) {
        speed = fmax(speed, fmax(fabs(quad->motion.velocity[i]), fabs(before[i])));
        spin = fmax(spin, fabs(quad->motion.rates[i]));
    }
    int still = quad->resting || (speed < 0.02 && spin < 0.05);
    quad->resting = quad->values[FAILURE] != FALL && touching && still && thrust < 0.7 * (MASS + quad->values[LOAD]) * GRAVITY;
    if (quad->resting) {
        memset(quad->motion.velocity, 0, sizeof quad->motion.velocity);
        memset(quad->motion.rates, 0, sizeof quad->motion.rates);
    }
}

/* Return a failure of FAILURE that is due, else NONE. */
static int advance(Quadrotor *quad, double step) {
    int failure = quad->time >= quad->values[FAIL_AT] ? (int)quad->values[FAILURE] : NONE;
    double middle[4], before[3], norm = 0;
    if (failure == CRASH) {
        fprintf(stderr, "a wrong address is written\n");
        *(volatile int *)8 = 1;
    }
    while (failure == HANG) {
        volatile int wait = 0;
        (void)wait;
    }
    if (fabs(step - STEP) > 1e-9) return DISCARD;
    memcpy(before, quad->motion.velocity, sizeof before);
    turn_rotors(quad, quad->rotors, middle);
    if (!quad->resting) {
        Motion half, d = slope(quad, &quad->motion, quad->rotors);
        add(&half, &quad->motion, &d, 0.5 * STEP);
        d = slope(quad, &half, middle);
        add(&quad->motion, &quad->motion, &d, STEP);
        for (int i = 0; i < 4; i++) norm += quad->motion.q[i] * quad->motion.q[i];
        for (int i = 0; i < 4; i++) quad->motion.q[i] /= sqrt(norm);
    }
    turn_rotors(quad, middle, quad->rotors);
    rest(quad, before);
    quad->time += step;
    give(quad);
    if (failure == NO_NUMBER) quad->values[POSITION + 2] = NAN;
    return failure;
}

#if FMI_VERSION == 2
fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String location,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    return create();
}
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean defined, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stop_defined, fmi2Real stop) {
    return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    give(c);
    return fmi2OK;
}
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t count, const fmi2Real value[]) {
    for (size_t i = 0; i < count; i++) ((Quadrotor *)c)->values[vr[i]] = value[i];
    return fmi2OK;
}
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t count, fmi2Real value[]) {
    for (size_t i = 0; i < count; i++) value[i] = ((Quadrotor *)c)->values[vr[i]];
    return fmi2OK;
}
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_state) {
    int failure = advance(c, step);
    return failure == DISCARD ? fmi2Discard : failure == ERROR ? fmi2Error : fmi2OK;
}
fmi2Status fmi2Terminate(fmi2Component c) { return fmi2OK; }
void fmi2FreeInstance(fmi2Component c) {
    free(c);
    puts("freed");
    fflush(stdout);
}
#else
static size_t width(fmi3ValueReference vr) {
    return vr == COMMANDS || vr == ATTITUDE || vr == ROTOR_SPEEDS ? 4
         : vr == GROUND || vr == VOLTAGE || vr == LOAD || vr >= FAIL_AT ? 1 : 3;
}
fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
                                         fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean events,
                                         fmi3Boolean early, const fmi3ValueReference required[], size_t count,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update) {
    return create();
}
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean defined, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean stop_defined, fmi3Float64 stop) {
    return fmi3OK;
}
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
    give(c);
    return fmi3OK;
}
fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t count, const fmi3Float64 value[],
                          size_t values) {
    for (size_t i = 0; i < count; value += width(vr[i]), i++)
        memcpy(((Quadrotor *)c)->values + vr[i], value, width(vr[i]) * sizeof *value);
    return fmi3OK;
}
fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t count, fmi3Float64 value[],
                          size_t values) {
    for (size_t i = 0; i < count; value += width(vr[i]), i++)
        memcpy(value, ((Quadrotor *)c)->values + vr[i], width(vr[i]) * sizeof *value);
    return fmi3OK;
}
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_state,
                      fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *reached) {
    int failure = advance(c, step);
    *event = *terminate = *early = fmi3False;
    *reached = time + step;
    return failure == DISCARD ? fmi3Discard : failure == ERROR ? fmi3Error : fmi3OK;
}
fmi3Status fmi3Terminate(fmi3Instance c) { return fmi3OK; }
void fmi3FreeInstance(fmi3Instance c) {
    free(c);
    puts("freed");
    fflush(stdout);
}
#endif
