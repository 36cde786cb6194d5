// The whole firmware above the hardware: messages to actions, and the tick from encoders to motors.
#include "robot.h" // this file's manual

#include "flash.h"    // IN_FLASH
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
#define TICKS_PER_S ((int32_t)(1000000 / ROBOT_TICK_US))

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

static void send_param(struct robot *robot, uint8_t param)
{
    struct msg_param_value told = {.param = param, .value = params_get(&robot->params, param)};
    uint8_t payload[MSG_PARAM_VALUE_SIZE];
    msg_param_value_encode(&told, payload);
    send(robot, MSG_PARAM_VALUE, payload, sizeof payload);
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
        .request = robot->requests.last,
        .outcome = robot->requests.outcome,
        .reason = robot->requests.reason,
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
    bool coast = supervisor_coasts(&robot->supervisor);
    drive_release(&robot->drive);
    move_pause(&robot->move);
    for (uint8_t side = 0; side < DRIVE_SIDES; side++) {
        motor_release(&robot->motors[side]);
        if (coast)
            hal_motor_coast(robot->hal, side);
        else
            hal_motor_set(robot->hal, side, 0);
    }
}

static void motors_follow(struct robot *robot, const int16_t setpoint_q4[DRIVE_SIDES])
{
    for (uint8_t side = 0; side < DRIVE_SIDES; side++) {
        int16_t duty = motor_update(&robot->motors[side], setpoint_q4[side], robot->battery_mv);
        hal_motor_set(robot->hal, side, duty);
    }
}

static void drive_on(struct robot *robot)
{
    drive_update(&robot->drive);
    motors_follow(robot, robot->drive.setpoint_q4);
}

static void move_on(struct robot *robot)
{
    int16_t setpoint_q4[DRIVE_SIDES];
    if (!move_update(&robot->move, motor_travel_um(&robot->motors[DRIVE_LEFT]),
                     motor_travel_um(&robot->motors[DRIVE_RIGHT]), setpoint_q4)) {
        drive_take_over(&robot->drive, setpoint_q4); // a DRIVE may end the move
        motors_follow(robot, setpoint_q4);
        return;
    }
    requests_end(&robot->requests, MSG_MOVE, OUTCOME_DONE, REFUSED_NONE);
    supervisor_move_ended(&robot->supervisor);
    motors_off(robot);
}

// --- Parameters ------------------------------------------------------------------------------------

static int16_t get16(const struct robot *robot, uint8_t param)
{
    return (int16_t)params_get(&robot->params, param);
}

static struct motor_gains gains_of(const struct robot *robot, uint8_t side)
{
    return (struct motor_gains){
        .static_duty = get16(robot, (uint8_t)(PARAM_STATIC_DUTY_LEFT + side)),
        .velocity_q8 = get16(robot, (uint8_t)(PARAM_VELOCITY_Q8_LEFT + side)),
        .acceleration_q8 = get16(robot, PARAM_ACCELERATION_Q8),
        .proportional_q8 = get16(robot, PARAM_PROPORTIONAL_Q8),
        .integral_q12 = get16(robot, PARAM_INTEGRAL_Q12),
        .integral_limit = get16(robot, PARAM_INTEGRAL_LIMIT),
        .duty_limit = MOTOR_DUTY_FULL,
        .battery_full_mv = (uint16_t)params_get(&robot->params, PARAM_BATTERY_FULL_MV),
    };
}

// The robot stands; wheels' counts go on, everything else begins anew.
static void apply_params(struct robot *robot)
{
    const struct params *params = &robot->params;
    struct drive_limits limits = {
        .track_um = params_get(params, PARAM_TRACK_UM),
        .speed_q4 = (int16_t)(params_get(params, PARAM_SPEED_MAX_MM_S) * 16),
        .step_q4 = (int16_t)(params_get(params, PARAM_ACCELERATION_MM_S2) * 16 / TICKS_PER_S),
    };
    drive_init(&robot->drive, &limits);
    struct watch_model models[DRIVE_SIDES];
    for (uint8_t side = 0; side < DRIVE_SIDES; side++) {
        struct motor_gains gains = gains_of(robot, side);
        motor_init(&robot->motors[side], &gains);
        uint16_t um_per_count = (uint16_t)params_get(params, (uint8_t)(PARAM_UM_PER_COUNT_LEFT + side));
        encoder_rescale(&robot->encoders[side], um_per_count);
        models[side] = (struct watch_model){um_per_count, gains.static_duty, gains.velocity_q8};
    }
    watch_init(&robot->watch, models);
    supervisor_watch_battery(&robot->supervisor, (uint16_t)params_get(params, PARAM_BATTERY_MIN_MV));
}

static void save_on(struct robot *robot)
{
    uint8_t saving = params_tick(&robot->params);
    if (saving == PARAMS_SAVED)
        requests_end(&robot->requests, MSG_PARAM_SAVE, OUTCOME_DONE, REFUSED_NONE);
    else if (saving == PARAMS_NOT_STORED)
        requests_end(&robot->requests, MSG_PARAM_SAVE, OUTCOME_ABORTED, REFUSED_NOT_STORED);
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

static uint8_t obey_stop(struct robot *robot, const uint8_t *payload)
{
    struct msg_stop stop;
    msg_stop_decode(&stop, payload);
    supervisor_stop(&robot->supervisor, stop.how);
    return 0;
}

static uint8_t obey_keep_alive(struct robot *robot, const uint8_t *payload)
{
    struct msg_keep_alive alive;
    msg_keep_alive_decode(&alive, payload);
    return supervisor_keep_alive(&robot->supervisor, robot->byte_us, alive.expires_us);
}

static uint8_t obey_param_read(struct robot *robot, const uint8_t *payload)
{
    struct msg_param_read read;
    msg_param_read_decode(&read, payload);
    if (!supervisor_in_session(&robot->supervisor))
        return REFUSED_NO_SESSION;
    if (read.param >= PARAM_COUNT)
        return REFUSED_BAD_VALUE;
    send_param(robot, read.param);
    return 0;
}

// --- Requests --------------------------------------------------------------------------------------

// Why a request may not even be looked at; 0 when it may.
static uint8_t request_refusal(const struct robot *robot, uint32_t boot_nonce, uint16_t number)
{
    if (boot_nonce != robot->supervisor.boot_nonce)
        return REFUSED_BAD_NONCE;
    if (!supervisor_in_session(&robot->supervisor))
        return REFUSED_NO_SESSION;
    return requests_refusal(&robot->requests, number);
}

// Begins either kind of move; what way and speed mean is its own affair.
typedef void (*move_beginner)(struct move *, const struct drive_limits *, int16_t way, uint16_t speed,
                              int32_t left_um, int32_t right_um);

static uint8_t begin_move(struct robot *robot, const struct msg_move *asked, move_beginner begin)
{
    uint8_t refusal = request_refusal(robot, asked->boot_nonce, asked->request);
    if (refusal != 0 || requests_repeats(&robot->requests, asked->request))
        return refusal;
    refusal = asked->speed_mm_s == 0
                ? (uint8_t)REFUSED_BAD_VALUE
                : supervisor_move(&robot->supervisor, robot->byte_us, asked->expires_us);
    if (refusal == 0)
        begin(&robot->move, &robot->drive.limits, asked->distance_mm, asked->speed_mm_s,
              motor_travel_um(&robot->motors[DRIVE_LEFT]), motor_travel_um(&robot->motors[DRIVE_RIGHT]));
    return requests_take(&robot->requests, MSG_MOVE, asked->request, refusal, true);
}

static uint8_t obey_move(struct robot *robot, const uint8_t *payload)
{
    struct msg_move move;
    msg_move_decode(&move, payload);
    return begin_move(robot, &move, move_begin_straight);
}

static uint8_t obey_turn(struct robot *robot, const uint8_t *payload)
{
    struct msg_turn turn;
    msg_turn_decode(&turn, payload);
    struct msg_move alike = {turn.boot_nonce, turn.request, turn.angle_mrad, turn.rate_mrad_s, turn.expires_us};
    return begin_move(robot, &alike, move_begin_turn);
}

// May parameters change now?
static uint8_t params_refusal(const struct robot *robot)
{
    return supervisor_stands(&robot->supervisor) ? 0 : REFUSED_NOT_STANDING;
}

static uint8_t obey_param_write(struct robot *robot, const uint8_t *payload)
{
    struct msg_param_write write;
    msg_param_write_decode(&write, payload);
    uint8_t refusal = request_refusal(robot, write.boot_nonce, write.request);
    if (refusal != 0)
        return refusal;
    if (!requests_repeats(&robot->requests, write.request)) {
        refusal = params_refusal(robot);
        if (refusal == 0 && !params_set(&robot->params, write.param, write.value))
            refusal = REFUSED_BAD_VALUE;
        if (refusal == 0)
            apply_params(robot);
        requests_take(&robot->requests, MSG_PARAM_WRITE, write.request, refusal, false);
    }
    if (robot->requests.outcome == OUTCOME_DONE && write.param < PARAM_COUNT)
        send_param(robot, write.param);
    return refusal;
}

static uint8_t obey_param_save(struct robot *robot, const uint8_t *payload)
{
    struct msg_param_save save;
    msg_param_save_decode(&save, payload);
    uint8_t refusal = request_refusal(robot, save.boot_nonce, save.request);
    if (refusal != 0 || requests_repeats(&robot->requests, save.request))
        return refusal;
    refusal = params_refusal(robot);
    if (refusal == 0)
        params_save(&robot->params);
    return requests_take(&robot->requests, MSG_PARAM_SAVE, save.request, refusal, true);
}

// A move whose end was not its own: say why.
static void end_move(struct robot *robot)
{
    static const IN_FLASH uint8_t reason_by_state[] = {
        [STATE_BOOT] = REFUSED_NO_SESSION,
        [STATE_READY] = REFUSED_BY_STOP,
        [STATE_DRIVING] = REFUSED_BY_DRIVE,
        [STATE_MOVING] = REFUSED_NONE,
        [STATE_STOPPED] = REFUSED_BY_STOP,
        [STATE_FAULT] = REFUSED_BY_FAULT,
    };
    uint8_t state = robot->supervisor.state;
    if (state != STATE_MOVING)
        requests_end(&robot->requests, MSG_MOVE, OUTCOME_ABORTED, reason_by_state[state]);
}

// --- Any message -----------------------------------------------------------------------------------

static uint8_t obey(struct robot *robot, uint8_t id, uint8_t seq, const uint8_t *payload)
{
    switch (id) {
    case MSG_HELLO_REQUEST: return obey_hello_request(robot, payload);
    case MSG_PING: return obey_ping(robot, payload);
    case MSG_DRIVE: return obey_drive(robot, seq, payload);
    case MSG_STOP: return obey_stop(robot, payload);
    case MSG_ESTOP: supervisor_estop(&robot->supervisor); return 0;
    case MSG_CLEAR: return obey_clear(robot, payload);
    case MSG_MOVE: return obey_move(robot, payload);
    case MSG_TURN: return obey_turn(robot, payload);
    case MSG_KEEP_ALIVE: return obey_keep_alive(robot, payload);
    case MSG_PARAM_READ: return obey_param_read(robot, payload);
    case MSG_PARAM_WRITE: return obey_param_write(robot, payload);
    case MSG_PARAM_SAVE: return obey_param_save(robot, payload);
    default: return 0; // the link hands on nothing else
    }
}

static void handle_message(void *context, uint8_t id, uint8_t seq, const uint8_t *payload)
{
    struct robot *robot = context;
    uint8_t refusal = obey(robot, id, seq, payload);
    if (!supervisor_may_run(&robot->supervisor))
        motors_off(robot); // before anything that takes time
    end_move(robot);
    if (refusal != 0)
        send_nack(robot, id, seq, refusal);
}

void robot_receive_byte(struct robot *robot, uint8_t byte, uint32_t now_us)
{
    robot->byte_us = now_us;
    link_receive_byte(&robot->link, byte);
}

// --- Start and tick --------------------------------------------------------------------------------

void robot_init(struct robot *robot, struct hal *hal)
{
    *robot = (struct robot){
        .hal = hal,
        .telemetry_in = TELEMETRY_TICKS,
        .link_status_in = LINK_STATUS_TICKS,
    };
    for (uint8_t side = 0; side < DRIVE_SIDES; side++)
        hal_motor_set(hal, side, 0); // before the EEPROM is read
    params_init(&robot->params, hal);
    for (uint8_t side = 0; side < DRIVE_SIDES; side++) {
        encoder_edges_init(&robot->edges[side], hal_encoder_pins(hal, side));
        encoder_init(&robot->encoders[side], &robot->edges[side], 1);
    }
    supervisor_init(&robot->supervisor, hal_boot_nonce(hal), hal_reset_cause(hal));
    apply_params(robot);
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
    for (uint8_t side = 0; side < DRIVE_SIDES; side++) {
        encoder_update(&robot->encoders[side], &edges[side], now_us);
        motor_sense(&robot->motors[side], &robot->encoders[side]);
    }
}

static uint8_t watch_wheels(struct robot *robot)
{
    struct watch_wheel wheels[DRIVE_SIDES];
    for (uint8_t side = 0; side < DRIVE_SIDES; side++) {
        wheels[side] = (struct watch_wheel){
            .setpoint_q4 = robot->motors[side].setpoint_q4,
            .duty = robot->motors[side].duty,
            .count = robot->encoders[side].count,
            .speed_q4 = robot->encoders[side].speed_q4,
        };
    }
    return watch_update(&robot->watch, wheels, supervisor_coasts(&robot->supervisor));
}

void robot_sense(struct robot *robot, uint32_t now_us)
{
    sense_wheels(robot, now_us);
    robot->battery_mv = hal_battery_mv(robot->hal);
}

void robot_control(struct robot *robot, uint32_t now_us)
{
    struct supervisor_senses senses = {
        .battery_mv = robot->battery_mv,
        .estop_pressed = hal_estop_pressed(robot->hal),
        .wheels_still = (robot->encoders[DRIVE_LEFT].speed_q4 | robot->encoders[DRIVE_RIGHT].speed_q4) == 0,
        .wheels = watch_wheels(robot),
    };
    supervisor_tick(&robot->supervisor, now_us, &senses);
    if (!supervisor_may_run(&robot->supervisor))
        motors_off(robot);
    else if (robot->supervisor.state == STATE_MOVING)
        move_on(robot);
    else
        drive_on(robot);
    end_move(robot);
    save_on(robot);
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
    robot_sense(robot, now_us);
    robot_control(robot, now_us);
    robot_report(robot, now_us);
}
