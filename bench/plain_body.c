/* Plain C for `bench/physics.py`: quadrotors with rotor lag, drag and a battery under position, attitude and
 * rate loops, by Runge-Kutta at 500 Hz. The equations of motion are those of simulation/world/dynamics.py in
 * the air; there are no sensors, no estimator and no ground. Compiled with -O2 into a shared library.
 */
#include <math.h>

enum { STATES = 19 }; /* position, velocity, quaternion, rates, rotors, charge, energy */

static const double STEP = 0.002, MASS = 1.5, GRAVITY = 9.80665, INERTIA[3] = {0.029, 0.029, 0.055};
static const double THRUST = 8.5e-6, TORQUE = 1.36e-7, LAG = 0.04, TOP = 1100.0, FULL = 16.8, EFFICIENCY = 0.75;
static const double LINEAR = 0.1, QUADRATIC = 0.02, SPIN = 0.005, IDLE = 5.0, CAPACITY = 18720.0, CELLS = 4.0;
static const double RESISTANCE = 0.02, ARM_X[4] = {0.18, -0.18, 0.18, -0.18}, ARM_Y[4] = {-0.18, 0.18, 0.18, -0.18};
static const double TURN[4] = {1.0, 1.0, -1.0, -1.0};

static double larger(double a, double b) { return a > b ? a : b; }
static double smaller(double a, double b) { return a < b ? a : b; }

static double cell_voltage(double left) {
    if (left >= 0.9) return 4.06 + (smaller(left, 1.0) - 0.9) * 1.4;
    if (left >= 0.5) return 3.84 + (left - 0.5) * 0.55;
    if (left >= 0.2) return 3.73 + (left - 0.2) * (11.0 / 30.0);
    if (left >= 0.1) return 3.67 + (left - 0.1) * 0.6;
    return 3.0 + larger(left, 0.0) * 6.7;
}

static void slope(const double *s, const double *motor, double *d) {
    double cubes = 0.0, lift = 0.0, torque[3] = {0.0, 0.0, 0.0};
    for (int i = 0; i < 4; i++) {
        double square = s[13 + i] * s[13 + i], thrust = THRUST * square;
        cubes += square * s[13 + i];
        lift += thrust;
        torque[0] += ARM_Y[i] * thrust;
        torque[1] -= ARM_X[i] * thrust;
        torque[2] += TURN[i] * TORQUE * square;
    }
    double power = TORQUE * cubes * (1.0 / EFFICIENCY) + IDLE;
    double open = cell_voltage(1.0 - s[17] * (1.0 / CAPACITY)) * CELLS;
    double room = open * open - 4.0 * RESISTANCE * power;
    double amps = room <= 0.0 ? open * (0.5 / RESISTANCE) : 2.0 * power / (open + sqrt(room));
    double volts = open - RESISTANCE * amps, top = volts * (TOP / FULL);
    for (int i = 0; i < 4; i++) d[13 + i] = (motor[i] * top - s[13 + i]) * (1.0 / LAG);
    d[17] = amps;
    d[18] = volts * amps;
    double w = s[6], x = s[7], y = s[8], z = s[9], p = s[10], q = s[11], r = s[12];
    double ae = 2.0 * (x * z + w * y), an = 2.0 * (y * z - w * x), au = 1.0 - 2.0 * (x * x + y * y);
    double along = s[3] * ae + s[4] * an + s[5] * au;
    double plane = sqrt(larger(0.0, s[3] * s[3] + s[4] * s[4] + s[5] * s[5] - along * along));
    double drag = LINEAR + QUADRATIC * plane;
    lift -= QUADRATIC * (fabs(along) - plane) * along;
    for (int i = 0; i < 3; i++) d[i] = s[3 + i];
    d[3] = (ae * lift - drag * s[3]) * (1.0 / MASS);
    d[4] = (an * lift - drag * s[4]) * (1.0 / MASS);
    d[5] = (au * lift - drag * s[5]) * (1.0 / MASS) - GRAVITY;
    d[6] = 0.5 * (-x * p - y * q - z * r);
    d[7] = 0.5 * (w * p + y * r - z * q);
    d[8] = 0.5 * (w * q - x * r + z * p);
    d[9] = 0.5 * (w * r + x * q - y * p);
    d[10] = (torque[0] - SPIN * p + (INERTIA[1] - INERTIA[2]) * q * r) * (1.0 / INERTIA[0]);
    d[11] = (torque[1] - SPIN * q + (INERTIA[2] - INERTIA[0]) * r * p) * (1.0 / INERTIA[1]);
    d[12] = (torque[2] - SPIN * r + (INERTIA[0] - INERTIA[1]) * p * q) * (1.0 / INERTIA[2]);
}

static double limit(double value, double most) { return smaller(larger(value, -most), most); }

/* Position, velocity, attitude and rate loops, level heading, and the mixer. `memory`: three rate integrals. */
static void control(const double *s, const double *goal, double *memory, double *motor) {
    double accel[3];
    for (int i = 0; i < 3; i++) accel[i] = limit(2.0 * (limit(goal[i] - s[i], 5.0) - s[3 + i]), 4.0);
    double sign = s[6] >= 0.0 ? 2.0 : -2.0, gain[3] = {0.11, 0.11, 0.5}, out[3];
    double wanted[3] = {4.5 * (-accel[1] / GRAVITY - sign * s[7]), 4.5 * (accel[0] / GRAVITY - sign * s[8]),
                        -4.0 * sign * s[9]};
    for (int i = 0; i < 3; i++) {
        double error = wanted[i] - s[10 + i];
        memory[i] = limit(memory[i] + 0.1 * error * STEP, 0.25);
        out[i] = gain[i] * error + memory[i];
    }
    double hover = MASS * (GRAVITY + accel[2]) / (4.0 * THRUST * TOP * TOP);
    for (int i = 0; i < 4; i++) {
        double share = hover + (out[0] * ARM_Y[i] - out[1] * ARM_X[i]) / 0.18 + 0.1 * out[2] * TURN[i];
        motor[i] = sqrt(smaller(larger(share, 0.0), 1.0));
    }
}

/* Advance `bodies` by `steps`; rows of states, goals and memories follow each other without gaps. */
void advance(double *states, const double *goals, double *memories, long bodies, long steps) {
    for (long body = 0; body < bodies; body++) {
        double *s = states + STATES * body, motor[4], a[STATES], b[STATES], c[STATES], d[STATES], at[STATES];
        for (long k = 0; k < steps; k++) {
            control(s, goals + 3 * body, memories + 3 * body, motor);
            slope(s, motor, a);
            for (int i = 0; i < STATES; i++) at[i] = s[i] + 0.5 * STEP * a[i];
            slope(at, motor, b);
            for (int i = 0; i < STATES; i++) at[i] = s[i] + 0.5 * STEP * b[i];
            slope(at, motor, c);
            for (int i = 0; i < STATES; i++) at[i] = s[i] + STEP * c[i];
            slope(at, motor, d);
            for (int i = 0; i < STATES; i++) s[i] += STEP / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]);
            double norm = sqrt(s[6] * s[6] + s[7] * s[7] + s[8] * s[8] + s[9] * s[9]);
            for (int i = 6; i < 10; i++) s[i] /= norm;
        }
    }
}
