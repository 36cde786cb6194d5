// A robot for C tests that rolls. See rolling_robot.h.
#include "rolling_robot.h" // what this file provides

#include <math.h>   // floor, fabs, copysign
#include <string.h> // memset

#include "host_frames.h" // frames to the robot
#include "motor.h"       // MOTOR_DUTY_FULL

#define STEP_US 250
#define FULL_BATTERY_V 7.4
#define COAST_LAG_S 0.5 // of an open motor

static const uint8_t forward_pins[4] = {0, 1, 3, 2};

// --- Start -----------------------------------------------------------------------------------------

void rolling_init(struct rolling *rolling)
{
    memset(rolling, 0, sizeof *rolling);
    memset(rolling->hal.eeprom, 0xFF, sizeof rolling->hal.eeprom);
    for (int side = 0; side < DRIVE_SIDES; side++) {
        rolling->wheels[side] = (struct rolling_wheel){
            .full_mm_s = 760, .lag_s = 0.05, .friction = 0.08, .mm_per_count = 5,
        };
    }
    rolling->battery_v = FULL_BATTERY_V;
    rolling->sag_v = 0.3;
    rolling->hal.battery_mv = (uint16_t)(rolling->battery_v * 1000);
    rolling->hal.reset_cause = RESET_POWER_ON;
    rolling->hal.boot_nonce = 0x5EED1234;
    robot_init(&rolling->robot, &rolling->hal);
}

// --- Wheels ----------------------------------------------------------------------------------------

static double duty_of(const struct rolling *rolling, int side)
{
    const struct rolling_wheel *wheel = &rolling->wheels[side];
    return wheel->stuck ? wheel->stuck_duty : rolling->hal.duty[side] / (double)MOTOR_DUTY_FULL;
}

static double sagging_v(const struct rolling *rolling)
{
    double load = fabs(duty_of(rolling, DRIVE_LEFT)) + fabs(duty_of(rolling, DRIVE_RIGHT));
    return rolling->battery_v - rolling->sag_v * load / 2;
}

// Speed after dt: a first-order motor whose friction, dry, holds it until it is overcome.
static void accelerate(struct rolling *rolling, int side, double dt)
{
    struct rolling_wheel *wheel = &rolling->wheels[side];
    if (wheel->blocked || wheel->pushed) {
        wheel->mm_s = wheel->blocked ? 0 : wheel->push_mm_s;
        return;
    }
    double push = duty_of(rolling, side) * sagging_v(rolling) / FULL_BATTERY_V + wheel->slope;
    double friction = wheel->friction + wheel->drag;
    double was = wheel->mm_s;
    if (was == 0 && fabs(push) <= friction)
        return;
    double aim = (push - copysign(friction, was != 0 ? was : push)) * wheel->full_mm_s;
    double lag = rolling->hal.coasting[side] && !wheel->stuck ? COAST_LAG_S : wheel->lag_s;
    wheel->mm_s += (aim - was) * dt / lag;
    if (was * wheel->mm_s < 0)
        wheel->mm_s = 0; // friction stops a wheel; it does not turn it
}

static void put_pins(struct rolling *rolling, int side, uint32_t now_us)
{
    const struct rolling_wheel *wheel = &rolling->wheels[side];
    uint8_t input = (uint8_t)(rolling->swapped ? !side : side);
    uint8_t held = rolling->hal.pins[input], pins = wheel->level;
    if (wheel->reversed)
        pins = (uint8_t)(pins >> 1 | (pins & 1) << 1);
    for (int channel = 0; channel < 2; channel++) {
        if (wheel->dead[channel])
            pins = (uint8_t)((pins & ~(1 << channel)) | (held & 1 << channel));
    }
    if (pins == held)
        return;
    rolling->hal.pins[input] = pins;
    robot_encoder_edge(&rolling->robot, input, pins, (uint16_t)(now_us / ENCODER_STAMP_US));
}

static double border_of(const struct rolling_wheel *wheel, int64_t cell)
{
    return ((double)cell + wheel->uneven[cell & 3]) * wheel->mm_per_count;
}

static void roll(struct rolling *rolling, int side, double dt, uint32_t now_us)
{
    struct rolling_wheel *wheel = &rolling->wheels[side];
    wheel->mm += wheel->mm_s * dt;
    for (;;) {
        if (wheel->mm >= border_of(wheel, wheel->cell + 1))
            wheel->cell++;
        else if (wheel->mm < border_of(wheel, wheel->cell))
            wheel->cell--;
        else
            return;
        wheel->level = forward_pins[wheel->cell & 3];
        put_pins(rolling, side, now_us);
    }
}

void rolling_tick(struct rolling *rolling)
{
    for (int step = 0; step < (int)ROBOT_TICK_US / STEP_US; step++) {
        rolling->now_us += STEP_US;
        for (int side = 0; side < DRIVE_SIDES; side++) {
            accelerate(rolling, side, STEP_US * 1e-6);
            roll(rolling, side, STEP_US * 1e-6, rolling->now_us);
        }
    }
    rolling->hal.battery_mv = (uint16_t)(sagging_v(rolling) * 1000);
    robot_tick(&rolling->robot, rolling->now_us);
    rolling->hal.uart_size = 0;
}

void rolling_ms(struct rolling *rolling, unsigned ms)
{
    for (unsigned done = 0; done < ms; done += ROBOT_TICK_US / 1000)
        rolling_tick(rolling);
}

// --- Messages --------------------------------------------------------------------------------------

static void tell(struct rolling *rolling, uint8_t id, const uint8_t *payload, uint8_t size)
{
    host_tell(&rolling->robot, rolling->now_us, id, rolling->seq++, payload, size);
}

void rolling_hello(struct rolling *rolling)
{
    struct msg_hello_request request = {.protocol_version = PROTOCOL_VERSION, .schema_hash = SCHEMA_HASH};
    uint8_t payload[MSG_HELLO_REQUEST_SIZE];
    msg_hello_request_encode(&request, payload);
    tell(rolling, MSG_HELLO_REQUEST, payload, sizeof payload);
}

void rolling_drive(struct rolling *rolling, int v_mm_s, int omega_mrad_s)
{
    struct msg_drive drive = {(int16_t)v_mm_s, (int16_t)omega_mrad_s, rolling->now_us + DEAD_MAN_US};
    uint8_t payload[MSG_DRIVE_SIZE];
    msg_drive_encode(&drive, payload);
    tell(rolling, MSG_DRIVE, payload, sizeof payload);
}

void rolling_stop(struct rolling *rolling, uint8_t how)
{
    tell(rolling, MSG_STOP, &how, MSG_STOP_SIZE);
}

void rolling_clear(struct rolling *rolling)
{
    struct msg_clear clear = {.boot_nonce = rolling->hal.boot_nonce};
    uint8_t payload[MSG_CLEAR_SIZE];
    msg_clear_encode(&clear, payload);
    tell(rolling, MSG_CLEAR, payload, sizeof payload);
}

void rolling_move(struct rolling *rolling, int distance_mm, unsigned speed_mm_s)
{
    struct msg_move move = {
        .boot_nonce = rolling->hal.boot_nonce,
        .request = ++rolling->request,
        .distance_mm = (int16_t)distance_mm,
        .speed_mm_s = (uint16_t)speed_mm_s,
        .expires_us = rolling->now_us + DEAD_MAN_US,
    };
    uint8_t payload[MSG_MOVE_SIZE];
    msg_move_encode(&move, payload);
    tell(rolling, MSG_MOVE, payload, sizeof payload);
}

void rolling_turn(struct rolling *rolling, int angle_mrad, unsigned rate_mrad_s)
{
    struct msg_turn turn = {
        .boot_nonce = rolling->hal.boot_nonce,
        .request = ++rolling->request,
        .angle_mrad = (int16_t)angle_mrad,
        .rate_mrad_s = (uint16_t)rate_mrad_s,
        .expires_us = rolling->now_us + DEAD_MAN_US,
    };
    uint8_t payload[MSG_TURN_SIZE];
    msg_turn_encode(&turn, payload);
    tell(rolling, MSG_TURN, payload, sizeof payload);
}

void rolling_keep_alive(struct rolling *rolling)
{
    struct msg_keep_alive alive = {.expires_us = rolling->now_us + DEAD_MAN_US};
    uint8_t payload[MSG_KEEP_ALIVE_SIZE];
    msg_keep_alive_encode(&alive, payload);
    tell(rolling, MSG_KEEP_ALIVE, payload, sizeof payload);
}

void rolling_drive_ms(struct rolling *rolling, unsigned ms, int v_mm_s, int omega_mrad_s)
{
    for (unsigned done = 0; done < ms; done += ROBOT_TICK_US / 1000) {
        if (done % 50 == 0)
            rolling_drive(rolling, v_mm_s, omega_mrad_s);
        rolling_tick(rolling);
    }
}
