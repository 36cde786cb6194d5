// Two motors of any make, driven by the firmware's encoders, motors, drive and moves; for Python.
//
// A motor goes to a speed with a lag, has a dead zone, and rubs: `rub` 1 brakes it by friction too when it is
// not driven, 0 leaves that to the lag alone. Its encoder's edges need not lie a quarter apart.
#include <math.h>    // exp, copysign
#include <stdbool.h> // bool
#include <stdlib.h>  // calloc, abs

#include "encoder.h" // under test
#include "motor.h"   // under test
#include "move.h"    // under test

#define STEP_S 0.0005
#define STEPS 10 // a tick
#define FULL_V 7.4
#define MM_PER_COUNT 5.0

static const uint8_t forward_pins[4] = {0, 1, 3, 2}; // (B << 1) | A

struct rig_motor {
    double full_mm_s; // at full duty and 7.4 V
    double dead_zone; // share of 7.4 V that does not move it
    double stiction;  // times that sets it going
    double lag_s;
    double rub;
    double edges[4]; // where they lie beyond their place, in counts
    double phase;    // of a count, where it begins
};

struct rig_wheel {
    struct rig_motor motor;
    double mm_s, counts;
    int cell;
    bool held, blind; // by a hand; its encoder dead
    int16_t duty;
    struct encoder_edges edges;
    struct encoder encoder;
    struct motor control;
};

struct rig {
    struct rig_wheel wheels[DRIVE_SIDES];
    double battery_v, sag_v;
    uint64_t us;
    struct drive_limits limits;
    struct move move;
};

static double border(const struct rig_wheel *wheel, int cell)
{
    return cell + wheel->motor.edges[cell & 3];
}

struct rig *rig_new(const struct rig_motor *left, const struct rig_motor *right, double full_v, double sag_v)
{
    struct rig *rig = calloc(1, sizeof *rig);
    // The defaults of host/link/parameters.py, whatever the motors are.
    struct motor_gains gains = {2600, 690, 0, 345, 140, 8000, MOTOR_DUTY_FULL, 7400};
    rig->battery_v = full_v;
    rig->sag_v = sag_v;
    rig->us = 1000000;
    rig->limits = (struct drive_limits){.track_um = 150000, .speed_q4 = 600 * 16, .step_q4 = 80};
    for (int side = 0; side < DRIVE_SIDES; side++) {
        struct rig_wheel *wheel = &rig->wheels[side];
        wheel->motor = side == DRIVE_LEFT ? *left : *right;
        wheel->counts = wheel->motor.phase;
        wheel->cell = -1;
        while (wheel->counts >= border(wheel, wheel->cell + 1))
            wheel->cell++;
        encoder_edges_init(&wheel->edges, forward_pins[wheel->cell & 3]);
        encoder_init(&wheel->encoder, &wheel->edges, (uint16_t)(MM_PER_COUNT * 1000));
        motor_init(&wheel->control, &gains);
    }
    return rig;
}

static double battery_v(const struct rig *rig)
{
    int load = abs(rig->wheels[DRIVE_LEFT].duty) + abs(rig->wheels[DRIVE_RIGHT].duty);
    return rig->battery_v - rig->sag_v * load / (2.0 * MOTOR_DUTY_FULL);
}

// Speed the motor goes to.
static double aim_mm_s(const struct rig_wheel *wheel, double volts)
{
    const struct rig_motor *motor = &wheel->motor;
    double drive = wheel->duty * volts / FULL_V / MOTOR_DUTY_FULL;
    double way = wheel->mm_s != 0 ? copysign(1, wheel->mm_s) : copysign(1, drive);
    double push = drive * way - motor->dead_zone; // along its way, friction against it
    if (push < 0 && drive * way > -motor->dead_zone)
        push *= motor->rub;
    else if (push < 0)
        push += (1 - motor->rub) * 2 * motor->dead_zone;
    return way * push * motor->full_mm_s / (1 - motor->dead_zone);
}

static void pass_edges(struct rig_wheel *wheel, double before, uint64_t us)
{
    for (;;) {
        int cell = wheel->cell;
        double edge = wheel->counts >= border(wheel, cell + 1) ? border(wheel, ++cell)
                    : wheel->counts < border(wheel, cell)      ? border(wheel, cell--)
                                                               : 0;
        if (cell == wheel->cell)
            return;
        wheel->cell = cell;
        uint64_t at_us = us + (uint64_t)((edge - before) / (wheel->counts - before) * STEP_S * 1e6);
        if (!wheel->blind)
            encoder_edge(&wheel->edges, forward_pins[cell & 3], (uint16_t)(at_us / ENCODER_STAMP_US));
    }
}

static void turn(struct rig_wheel *wheel, double volts, uint64_t us)
{
    const struct rig_motor *motor = &wheel->motor;
    double drive = fabs(wheel->duty * volts / FULL_V / MOTOR_DUTY_FULL);
    double before = wheel->mm_s, was = wheel->counts;
    bool rests = before == 0 && drive <= motor->dead_zone * motor->stiction;
    if (wheel->held || rests) {
        wheel->mm_s = 0;
        return;
    }
    double aim = aim_mm_s(wheel, volts);
    wheel->mm_s = aim + (before - aim) * exp(-STEP_S / motor->lag_s);
    if (before * wheel->mm_s < 0 || (fabs(wheel->mm_s) < 0.5 && drive <= motor->dead_zone))
        wheel->mm_s = 0;
    wheel->counts += (before + wheel->mm_s) / 2 * STEP_S / MM_PER_COUNT;
    pass_edges(wheel, was, us);
}

static void sense(struct rig *rig)
{
    for (int side = 0; side < DRIVE_SIDES; side++) {
        struct rig_wheel *wheel = &rig->wheels[side];
        encoder_update(&wheel->encoder, &wheel->edges, (uint32_t)rig->us);
        motor_sense(&wheel->control, &wheel->encoder);
    }
}

static void drive(struct rig *rig, const int16_t setpoint_q4[DRIVE_SIDES])
{
    uint16_t battery_mv = (uint16_t)(battery_v(rig) * 1000);
    for (int side = 0; side < DRIVE_SIDES; side++)
        rig->wheels[side].duty = motor_update(&rig->wheels[side].control, setpoint_q4[side], battery_mv);
    for (int step = 0; step < STEPS; step++) {
        double volts = battery_v(rig);
        for (int side = 0; side < DRIVE_SIDES; side++)
            turn(&rig->wheels[side], volts, rig->us);
        rig->us += (uint64_t)(STEP_S * 1e6);
    }
}

// One tick at these setpoints.
void rig_tick(struct rig *rig, int16_t left_q4, int16_t right_q4)
{
    const int16_t setpoint_q4[DRIVE_SIDES] = {left_q4, right_q4};
    sense(rig);
    drive(rig, setpoint_q4);
}

// A whole move; how many ticks it took, or -1 if it did not end. Pauses for 0.4 s after so many ticks, 0:
// never.
int rig_move(struct rig *rig, bool turns, int16_t amount, uint16_t speed, int pause_at, int ticks_most)
{
    sense(rig);
    int32_t left_um = motor_travel_um(&rig->wheels[DRIVE_LEFT].control);
    int32_t right_um = motor_travel_um(&rig->wheels[DRIVE_RIGHT].control);
    if (turns)
        move_begin_turn(&rig->move, &rig->limits, amount, speed, left_um, right_um);
    else
        move_begin_straight(&rig->move, &rig->limits, amount, speed, left_um, right_um);
    for (int tick = 1; tick <= ticks_most; tick++) {
        int16_t setpoint_q4[DRIVE_SIDES];
        bool done = move_update(&rig->move, motor_travel_um(&rig->wheels[DRIVE_LEFT].control),
                                motor_travel_um(&rig->wheels[DRIVE_RIGHT].control), setpoint_q4);
        if (done)
            return tick;
        drive(rig, setpoint_q4);
        for (int pause = 0; tick == pause_at && pause < 80; pause++) {
            move_pause(&rig->move);
            rig_tick(rig, 0, 0);
        }
        sense(rig);
    }
    return -1;
}

void rig_hold(struct rig *rig, uint8_t side, bool held)
{
    rig->wheels[side].held = held;
}

void rig_blind(struct rig *rig, uint8_t side)
{
    rig->wheels[side].blind = true;
}

double rig_mm_s(struct rig *rig, uint8_t side)
{
    return rig->wheels[side].mm_s;
}

double rig_mm(struct rig *rig, uint8_t side)
{
    return (rig->wheels[side].counts - rig->wheels[side].motor.phase) * MM_PER_COUNT;
}

int16_t rig_encoder_q4(struct rig *rig, uint8_t side)
{
    return rig->wheels[side].encoder.speed_q4;
}

int16_t rig_wheel_q4(struct rig *rig, uint8_t side)
{
    return wheel_speed_q4(&rig->wheels[side].control.wheel);
}
