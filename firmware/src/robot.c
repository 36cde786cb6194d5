// The whole firmware above the hardware: messages to actions, and the tick from encoders to motors.
#include "robot.h" // this file's manual

#include "messages.h" // what the bytes of each message mean

// Names the sources this was built from; the build sets it, 0 means that nobody did.
#ifndef ROBOT_BUILD_ID
#define ROBOT_BUILD_ID 0u
#endif

_Static_assert(ENCODER_NO_EDGE_US == NO_EDGE_US, "telemetry hands edge ages on as they are");
_Static_assert(TELEMETRY_PERIOD_US % ROBOT_TICK_US == 0, "telemetry leaves on a tick");
_Static_assert(LINK_STATUS_PERIOD_US % ROBOT_TICK_US == 0, "link status leaves on a tick");

#define TELEMETRY_TICKS (TELEMETRY_PERIOD_US / ROBOT_TICK_US)
#define LINK_STATUS_TICKS (LINK_STATUS_PERIOD_US / ROBOT_TICK_US)

// A 6 V gear motor on two lithium cells: starts at 8 % duty, 0.7 m/s at full duty. Proportional is half the
// slope of that, its integral time 0.2 s. The integral's limit makes up for unequal motors and a low battery
// and no more, for it is also how far a wheel runs away when its encoder breaks.
#define GEAR_MOTOR                                                                         \
    {                                                                                      \
        .static_duty = 2600, .velocity_q8 = 690, .proportional_q8 = 345,                   \
        .integral_q12 = 140, .integral_limit = 8000, .duty_limit = MOTOR_DUTY_FULL,        \
    }

const struct robot_params robot_params_default = {
    .um_per_count = 5000,
    .track_um = 150000,
    .battery_min_mv = 6400,
    .wheel_speed_q4 = 600 * 16,
    .wheel_step_q4 = 80, // 1 m/s^2
    .gains = {GEAR_MOTOR, GEAR_MOTOR},
};

// --- Out to the line -------------------------------------------------------------------------------

static void put_byte(void *context, uint8_t byte)
{
    struct robot *robot = context;
    hal_uart_put(robot->hal, byte);
}

static void send(struct robot *robot, uint8_t id, const uint8_t *payload, uint8_t size)
{
    link_send(&robot->link, id, payload, size, hal_uart_room(robot->hal));
}

static void send_hello(struct robot *robot)
{
    struct msg_hello hello = {
        .protocol_version = PROTOCOL_VERSION,
        .schema_hash = SCHEMA_HASH,
        .build_id = ROBOT_BUILD_ID,
        .reset_cause = hal_reset_cause(robot->hal),
        .boot_nonce = robot->supervisor.boot_nonce,
    };
    uint8_t payload[MSG_HELLO_SIZE];
    msg_hello_encode(&hello, payload);
    send(robot, MSG_HELLO, payload, sizeof payload);
}

static void send_pong(struct robot *robot, uint32_t host_time_us)
{
    struct msg_pong pong = {.host_time_us = host_time_us, .mcu_time_us = robot->byte_us};
    uint8_t payload[MSG_PONG_SIZE];
    msg_pong_encode(&pong, payload);
    send(robot, MSG_PONG, payload, sizeof payload);
}

static void send_nack(struct robot *robot, uint8_t message, uint8_t seq, uint8_t reason)
{
    struct msg_nack nack = {.message = message, .seq = seq, .reason = reason};
    uint8_t payload[MSG_NACK_SIZE];
    msg_nack_encode(&nack, payload);
    send(robot, MSG_NACK, payload, sizeof payload);
}

static int16_t permille(int16_t duty)
{
    return (int16_t)((int32_t)duty * 1000 / MOTOR_DUTY_FULL);
}

static int16_t rounded_mm_s(int16_t speed_q4)
{
    return (int16_t)((speed_q4 + (speed_q4 < 0 ? -8 : 8)) / 16);
}

static void send_telemetry(struct robot *robot, uint32_t now_us)
{
    const struct encoder *left = &robot->encoders[DRIVE_LEFT], *right = &robot->encoders[DRIVE_RIGHT];
    struct msg_telemetry telemetry = {
        .mcu_time_us = now_us,
        .state = robot->supervisor.state,
        .fault = robot->supervisor.fault,
        .count_left = left->count,
        .count_right = right->count,
        .edge_age_left_us = left->edge_age_us,
        .edge_age_right_us = right->edge_age_us,
        .speed_left_mm_s = rounded_mm_s(left->speed_q4),
        .speed_right_mm_s = rounded_mm_s(right->speed_q4),
        .duty_left_permille = permille(robot->motors[DRIVE_LEFT].duty),
        .duty_right_permille = permille(robot->motors[DRIVE_RIGHT].duty),
        .battery_mv = robot->battery_mv,
        .illegal_left = left->illegal,
        .illegal_right = right->illegal,
        .boot_nonce = robot->supervisor.boot_nonce,
        .drive_seq = robot->drive_seq,
        .direction_left = left->direction,
        .direction_right = right->direction,
    };
    uint8_t payload[MSG_TELEMETRY_SIZE];
    msg_telemetry_encode(&telemetry, payload);
    send(robot, MSG_TELEMETRY, payload, sizeof payload);
}

static void send_link_status(struct robot *robot)
{
    robot->link.counters.rx_overrun = hal_uart_lost(robot->hal);
    uint8_t payload[MSG_LINK_STATUS_SIZE];
    msg_link_status_encode(&robot->link.counters, payload);
    send(robot, MSG_LINK_STATUS, payload, sizeof payload);
}

// --- Motors ----------------------------------------------------------------------------------------

static void motors_off(struct robot *robot)
{
    drive_release(&robot->drive);
    for (uint8_t side = 0; side < DRIVE_SIDES; side++) {
        motor_release(&robot->motors[side]);
        hal_motor_set(robot->hal, side, 0);
    }
}

static void motors_follow(struct robot *robot)
{
    drive_update(&robot->drive);
    for (uint8_t side = 0; side < DRIVE_SIDES; side++) {
        int16_t duty = motor_update(&robot->motors[side], robot->drive.setpoint_q4[side],
                                    robot->encoders[side].speed_q4, robot->battery_mv);
        hal_motor_set(robot->hal, side, duty);
    }
}

// --- In from the line ------------------------------------------------------------------------------

static uint8_t obey_hello_request(struct robot *robot, const uint8_t *payload)
{
    struct msg_hello_request request;
    msg_hello_request_decode(&request, payload);
    uint8_t refusal = supervisor_hello(&robot->supervisor, request.protocol_version, request.schema_hash);
    send_hello(robot); // a host that speaks another schema must learn which one this is
    return refusal;
}

static uint8_t obey_ping(struct robot *robot, const uint8_t *payload)
{
    struct msg_ping ping;
    msg_ping_decode(&ping, payload);
    send_pong(robot, ping.host_time_us);
    return 0;
}

static uint8_t obey_drive(struct robot *robot, uint8_t seq, const uint8_t *payload)
{
    struct msg_drive command;
    msg_drive_decode(&command, payload);
    uint8_t refusal = supervisor_drive(&robot->supervisor, robot->byte_us, command.expires_us);
    if (refusal == 0) {
        drive_command(&robot->drive, command.v_mm_s, command.omega_mrad_s);
        robot->drive_seq = seq;
    }
    return refusal;
}

static uint8_t obey_clear(struct robot *robot, const uint8_t *payload)
{
    struct msg_clear clear;
    msg_clear_decode(&clear, payload);
    return supervisor_clear(&robot->supervisor, clear.boot_nonce);
}

static uint8_t obey(struct robot *robot, uint8_t id, uint8_t seq, const uint8_t *payload)
{
    switch (id) {
    case MSG_HELLO_REQUEST: return obey_hello_request(robot, payload);
    case MSG_PING: return obey_ping(robot, payload);
    case MSG_DRIVE: return obey_drive(robot, seq, payload);
    case MSG_STOP: supervisor_stop(&robot->supervisor); return 0;
    case MSG_ESTOP: supervisor_estop(&robot->supervisor); return 0;
    case MSG_CLEAR: return obey_clear(robot, payload);
    default: return 0; // the link hands on nothing else
    }
}

static void handle_message(void *context, uint8_t id, uint8_t seq, const uint8_t *payload)
{
    struct robot *robot = context;
    uint8_t refusal = obey(robot, id, seq, payload);
    if (!supervisor_may_run(&robot->supervisor))
        motors_off(robot); // before anything that takes time
    if (refusal != 0)
        send_nack(robot, id, seq, refusal);
}

void robot_receive_byte(struct robot *robot, uint8_t byte, uint32_t now_us)
{
    robot->byte_us = now_us;
    link_receive_byte(&robot->link, byte);
}

// --- Start and tick --------------------------------------------------------------------------------

void robot_init(struct robot *robot, struct hal *hal, const struct robot_params *params)
{
    *robot = (struct robot){
        .hal = hal,
        .telemetry_in = TELEMETRY_TICKS,
        .link_status_in = LINK_STATUS_TICKS,
    };
    struct drive_limits limits = {
        .track_um = params->track_um,
        .speed_q4 = params->wheel_speed_q4,
        .step_q4 = params->wheel_step_q4,
    };
    drive_init(&robot->drive, &limits);
    for (uint8_t side = 0; side < DRIVE_SIDES; side++) {
        motor_init(&robot->motors[side], &params->gains[side]);
        encoder_edges_init(&robot->edges[side], hal_encoder_pins(hal, side));
        encoder_init(&robot->encoders[side], &robot->edges[side], params->um_per_count);
    }
    motors_off(robot);
    supervisor_init(&robot->supervisor, hal_boot_nonce(hal), params->battery_min_mv);
    link_init(&robot->link, handle_message, put_byte, robot);
    send_hello(robot);
}

static void sense_wheels(struct robot *robot, uint32_t now_us)
{
    struct encoder_edges edges[DRIVE_SIDES];
    uint8_t before = hal_interrupts_off(robot->hal);
    edges[DRIVE_LEFT] = robot->edges[DRIVE_LEFT];
    edges[DRIVE_RIGHT] = robot->edges[DRIVE_RIGHT];
    hal_interrupts_restore(robot->hal, before);
    for (uint8_t side = 0; side < DRIVE_SIDES; side++)
        encoder_update(&robot->encoders[side], &edges[side], now_us);
}

void robot_control(struct robot *robot, uint32_t now_us)
{
    sense_wheels(robot, now_us);
    robot->battery_mv = hal_battery_mv(robot->hal);
    struct supervisor_senses senses = {
        .battery_mv = robot->battery_mv,
        .estop_pressed = hal_estop_pressed(robot->hal),
        .wheels_still = (robot->encoders[DRIVE_LEFT].speed_q4 | robot->encoders[DRIVE_RIGHT].speed_q4) == 0,
    };
    supervisor_tick(&robot->supervisor, now_us, &senses);
    if (supervisor_may_run(&robot->supervisor))
        motors_follow(robot);
    else
        motors_off(robot);
}

void robot_report(struct robot *robot, uint32_t now_us)
{
    if (--robot->telemetry_in == 0) {
        robot->telemetry_in = TELEMETRY_TICKS;
        send_telemetry(robot, now_us);
    }
    if (--robot->link_status_in == 0) {
        robot->link_status_in = LINK_STATUS_TICKS;
        send_link_status(robot);
    }
}

void robot_tick(struct robot *robot, uint32_t now_us)
{
    robot_control(robot, now_us);
    robot_report(robot, now_us);
}
