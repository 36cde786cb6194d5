// Specification of robot.c: what the firmware does at start, for each message, and every tick.
#include <setjmp.h> // cmocka
#include <stdarg.h> // cmocka
#include <stddef.h> // cmocka
#include <stdint.h> // cmocka

#include <cmocka.h> // the test framework
#include <string.h> // memset

#include "fake_hal.h"    // hardware of variables
#include "host_frames.h" // what a host says
#include "messages.h"    // what is said on the line
#include "robot.h"       // what is specified here

#define NONCE 0xB0071234u

static struct {
    struct hal hal;
    struct robot robot;
    uint8_t seq;
    uint32_t now_us;
    unsigned read; // bytes of hal.uart already looked at
} rig;

// --- A host ----------------------------------------------------------------------------------------

static void tell(uint8_t id, const uint8_t *payload, uint8_t size)
{
    host_tell(&rig.robot, rig.now_us, id, rig.seq++, payload, size);
}

static void tell_hello(uint32_t schema_hash)
{
    struct msg_hello_request request = {.protocol_version = PROTOCOL_VERSION, .schema_hash = schema_hash};
    uint8_t payload[MSG_HELLO_REQUEST_SIZE];
    msg_hello_request_encode(&request, payload);
    tell(MSG_HELLO_REQUEST, payload, sizeof payload);
}

static void tell_drive(int16_t v_mm_s, int16_t omega_mrad_s)
{
    struct msg_drive drive = {v_mm_s, omega_mrad_s, rig.now_us + DEAD_MAN_US};
    uint8_t payload[MSG_DRIVE_SIZE];
    msg_drive_encode(&drive, payload);
    tell(MSG_DRIVE, payload, sizeof payload);
}

static void tell_clear(uint32_t nonce)
{
    struct msg_clear clear = {.boot_nonce = nonce};
    uint8_t payload[MSG_CLEAR_SIZE];
    msg_clear_encode(&clear, payload);
    tell(MSG_CLEAR, payload, sizeof payload);
}

static void tell_stop(uint8_t how)
{
    tell(MSG_STOP, &how, MSG_STOP_SIZE);
}

static void tell_move(uint32_t nonce, uint16_t request, int16_t distance_mm, uint16_t speed_mm_s,
                      uint32_t hold_us)
{
    struct msg_move move = {nonce, request, distance_mm, speed_mm_s, rig.now_us + hold_us};
    uint8_t payload[MSG_MOVE_SIZE];
    msg_move_encode(&move, payload);
    tell(MSG_MOVE, payload, sizeof payload);
}

static void tell_turn(uint32_t nonce, uint16_t request, int16_t angle_mrad, uint16_t rate_mrad_s)
{
    struct msg_turn turn = {nonce, request, angle_mrad, rate_mrad_s, rig.now_us + DEAD_MAN_US};
    uint8_t payload[MSG_TURN_SIZE];
    msg_turn_encode(&turn, payload);
    tell(MSG_TURN, payload, sizeof payload);
}

static void tell_keep_alive(uint32_t hold_us)
{
    struct msg_keep_alive alive = {rig.now_us + hold_us};
    uint8_t payload[MSG_KEEP_ALIVE_SIZE];
    msg_keep_alive_encode(&alive, payload);
    tell(MSG_KEEP_ALIVE, payload, sizeof payload);
}

static void tell_param_read(uint8_t param)
{
    tell(MSG_PARAM_READ, &param, MSG_PARAM_READ_SIZE);
}

static void tell_param_write(uint32_t nonce, uint16_t request, uint8_t param, int32_t value)
{
    struct msg_param_write write = {nonce, request, param, value};
    uint8_t payload[MSG_PARAM_WRITE_SIZE];
    msg_param_write_encode(&write, payload);
    tell(MSG_PARAM_WRITE, payload, sizeof payload);
}

static void tell_param_save(uint32_t nonce, uint16_t request)
{
    struct msg_param_save save = {nonce, request};
    uint8_t payload[MSG_PARAM_SAVE_SIZE];
    msg_param_save_encode(&save, payload);
    tell(MSG_PARAM_SAVE, payload, sizeof payload);
}

// The next message the robot has sent; its id, or 0 when there is none. Fails on a broken frame.
static uint8_t hear(uint8_t *payload)
{
    if (rig.read == rig.hal.uart_size)
        return 0;
    uint8_t raw[80];
    unsigned size = 0;
    while (rig.hal.uart[rig.read] != 0) {
        uint8_t code = rig.hal.uart[rig.read++];
        if (size > 0)
            raw[size++] = 0;
        while (--code > 0)
            raw[size++] = rig.hal.uart[rig.read++];
        if (size == 0 && rig.hal.uart[rig.read] != 0)
            fail_msg("a frame does not begin with a zero");
    }
    rig.read++;
    assert_true(size >= LINK_OVERHEAD);
    uint8_t checked = (uint8_t)(size - 4);
    assert_int_equal(link_crc32c(raw, checked), msg_get_u32(raw + checked));
    memcpy(payload, raw + 2, checked - 2u);
    return raw[0];
}

// Passes over what else was sent.
static void expect_heard(uint8_t id, uint8_t *payload)
{
    for (uint8_t heard = hear(payload); heard != id; heard = hear(payload))
        assert_int_not_equal(heard, 0);
}

static void expect_nack(uint8_t message, uint8_t reason)
{
    uint8_t payload[64];
    struct msg_nack nack;
    expect_heard(MSG_NACK, payload);
    msg_nack_decode(&nack, payload);
    assert_int_equal(nack.message, message);
    assert_int_equal(nack.seq, (uint8_t)(rig.seq - 1));
    assert_int_equal(nack.reason, reason);
}

static struct msg_telemetry latest_telemetry(void)
{
    uint8_t payload[64];
    struct msg_telemetry telemetry;
    memset(&telemetry, 0xFF, sizeof telemetry);
    for (uint8_t id = hear(payload); id != 0; id = hear(payload)) {
        if (id == MSG_TELEMETRY)
            msg_telemetry_decode(&telemetry, payload);
    }
    return telemetry;
}

static void ticks(unsigned count)
{
    while (count-- > 0) {
        rig.now_us += ROBOT_TICK_US;
        robot_tick(&rig.robot, rig.now_us);
    }
}

static void turn(uint8_t side, int counts)
{
    static const uint8_t forward_pins[4] = {0, 1, 3, 2};
    static unsigned position[DRIVE_SIDES];
    while (counts != 0) {
        position[side] += counts > 0 ? 1u : (unsigned)-1;
        counts += counts > 0 ? -1 : 1;
        robot_encoder_edge(&rig.robot, side, forward_pins[position[side] & 3],
                           (uint16_t)(rig.now_us / ENCODER_STAMP_US));
    }
    rig.hal.pins[side] = forward_pins[position[side] & 3];
}

static int start(void **state)
{
    (void)state;
    uint8_t pins[DRIVE_SIDES] = {rig.hal.pins[DRIVE_LEFT], rig.hal.pins[DRIVE_RIGHT]};
    memset(&rig, 0, sizeof rig);
    rig.hal.pins[DRIVE_LEFT] = pins[DRIVE_LEFT];
    rig.hal.pins[DRIVE_RIGHT] = pins[DRIVE_RIGHT];
    rig.hal.duty[DRIVE_LEFT] = rig.hal.duty[DRIVE_RIGHT] = 12345; // as if left over from before the reset
    rig.hal.uart_room = UINT16_MAX;
    rig.hal.battery_mv = 7400;
    rig.hal.reset_cause = RESET_BROWN_OUT;
    rig.hal.boot_nonce = NONCE;
    memset(rig.hal.eeprom, 0xFF, sizeof rig.hal.eeprom);
    robot_init(&rig.robot, &rig.hal);
    return 0;
}

static int session(void **state)
{
    start(state);
    tell_hello(SCHEMA_HASH);
    return 0;
}

static int driving(void **state)
{
    session(state);
    tell_drive(200, 0);
    ticks(20);
    return 0;
}

static void expect_motors_off(void)
{
    assert_int_equal(rig.hal.duty[DRIVE_LEFT], 0);
    assert_int_equal(rig.hal.duty[DRIVE_RIGHT], 0);
}

// --- Start -----------------------------------------------------------------------------------------

static void the_motors_are_off_before_anything_else_happens(void **state)
{
    (void)state;
    expect_motors_off();
    ticks(1000);
    expect_motors_off();
}

static void hello_is_said_unasked_after_a_start(void **state)
{
    (void)state;
    uint8_t payload[64];
    struct msg_hello hello;
    assert_int_equal(hear(payload), MSG_HELLO);
    msg_hello_decode(&hello, payload);
    assert_int_equal(hello.protocol_version, PROTOCOL_VERSION);
    assert_int_equal(hello.schema_hash, SCHEMA_HASH);
    assert_int_equal(hello.reset_cause, RESET_BROWN_OUT);
    assert_int_equal(hello.boot_nonce, NONCE);
    assert_int_equal(hear(payload), 0);
}

static void a_wheel_standing_at_any_pins_starts_with_no_count_and_no_fault(void **state)
{
    for (int i = 0; i < 4; i++) {
        start(state);
        robot_encoder_edge(&rig.robot, DRIVE_LEFT, rig.hal.pins[DRIVE_LEFT], 0);
        ticks(2);
        struct msg_telemetry telemetry = latest_telemetry();
        assert_int_equal(telemetry.count_left, 0);
        assert_int_equal(telemetry.illegal_left, 0);
        turn(DRIVE_LEFT, 1);
    }
}

// --- Messages --------------------------------------------------------------------------------------

static void hello_is_answered_and_opens_the_way_to_driving(void **state)
{
    (void)state;
    uint8_t payload[64];
    tell_drive(200, 0);
    expect_nack(MSG_DRIVE, REFUSED_NO_SESSION);
    tell_hello(SCHEMA_HASH);
    assert_int_equal(hear(payload), MSG_HELLO);
    tell_drive(200, 0);
    ticks(1);
    assert_true(rig.hal.duty[DRIVE_LEFT] > 0);
    assert_true(rig.hal.duty[DRIVE_RIGHT] > 0);
}

static void a_foreign_host_hears_who_this_is_and_that_it_was_refused(void **state)
{
    (void)state;
    uint8_t payload[64];
    assert_int_equal(hear(payload), MSG_HELLO); // of the start
    tell_hello(SCHEMA_HASH + 1);
    assert_int_equal(hear(payload), MSG_HELLO);
    expect_nack(MSG_HELLO_REQUEST, REFUSED_SCHEMA);
}

static void ping_is_answered_with_its_own_number_and_the_time_it_came(void **state)
{
    (void)state;
    uint8_t payload[64];
    struct msg_ping ping = {.host_time_us = 0xDEADBEEF};
    struct msg_pong pong;
    msg_ping_encode(&ping, payload);
    rig.now_us = 123456;
    tell(MSG_PING, payload, MSG_PING_SIZE);
    expect_heard(MSG_PONG, payload);
    msg_pong_decode(&pong, payload);
    assert_int_equal(pong.host_time_us, 0xDEADBEEF);
    assert_int_equal(pong.mcu_time_us, 123456);
}

static void the_last_byte_of_an_estop_has_zeroed_the_motors(void **state)
{
    (void)state;
    assert_true(rig.hal.duty[DRIVE_LEFT] > 0);
    tell(MSG_ESTOP, NULL, 0);
    expect_motors_off(); // no tick in between
    ticks(2);
    expect_motors_off();
    struct msg_telemetry telemetry = latest_telemetry();
    assert_int_equal(telemetry.state, STATE_FAULT);
    assert_int_equal(telemetry.fault, FAULT_ESTOP_FRAME);
    tell_drive(200, 0);
    expect_nack(MSG_DRIVE, REFUSED_FAULT_LATCHED);
    ticks(1);
    expect_motors_off();
}

static void an_estop_between_the_parts_of_a_tick_is_obeyed_and_reported(void **state)
{
    (void)state;
    robot_sense(&rig.robot, rig.now_us);
    robot_control(&rig.robot, rig.now_us);
    robot_report(&rig.robot, rig.now_us);
    rig.now_us += ROBOT_TICK_US;
    robot_sense(&rig.robot, rig.now_us);
    robot_control(&rig.robot, rig.now_us);
    assert_true(rig.hal.duty[DRIVE_LEFT] > 0);
    tell(MSG_ESTOP, NULL, 0);
    assert_int_equal(rig.hal.duty[DRIVE_LEFT], 0);
    assert_int_equal(rig.hal.duty[DRIVE_RIGHT], 0);
    robot_report(&rig.robot, rig.now_us);
    assert_int_equal(latest_telemetry().fault, FAULT_ESTOP_FRAME);
}

static void a_drive_between_the_parts_of_a_tick_is_not_taken_for_an_old_one(void **state)
{
    (void)state;
    robot_sense(&rig.robot, rig.now_us);
    rig.now_us += 100;
    tell_drive(200, 0);
    robot_control(&rig.robot, rig.now_us);
    assert_true(rig.hal.duty[DRIVE_LEFT] > 0);
    robot_report(&rig.robot, rig.now_us);
    assert_int_equal(latest_telemetry().fault, FAULT_NONE);
}

static void an_estop_needs_no_session_and_no_order(void **state)
{
    (void)state;
    rig.seq = (uint8_t)(rig.seq - 2); // an old sequence number
    tell(MSG_ESTOP, NULL, 0);
    expect_motors_off();
    assert_int_equal(rig.robot.supervisor.fault, FAULT_ESTOP_FRAME);
}

static void clear_with_the_right_nonce_allows_driving_again(void **state)
{
    (void)state;
    tell(MSG_ESTOP, NULL, 0);
    tell_clear(NONCE + 1);
    expect_nack(MSG_CLEAR, REFUSED_BAD_NONCE);
    tell_clear(NONCE);
    ticks(1);
    expect_motors_off();
    tell_drive(200, 0);
    ticks(1);
    assert_true(rig.hal.duty[DRIVE_LEFT] > 0);
}

static void stop_brakes_at_once(void **state)
{
    (void)state;
    tell(MSG_STOP, (const uint8_t[]){STOP_BRAKE}, MSG_STOP_SIZE);
    expect_motors_off();
    ticks(1);
    expect_motors_off();
}

static void a_refused_drive_changes_nothing(void **state)
{
    (void)state;
    int16_t target_q4 = rig.robot.drive.target_q4[DRIVE_LEFT];
    uint8_t seq = rig.robot.drive_seq;
    struct msg_drive late = {-300, 0, rig.now_us - 1};
    uint8_t payload[MSG_DRIVE_SIZE];
    msg_drive_encode(&late, payload);
    tell(MSG_DRIVE, payload, sizeof payload);
    expect_nack(MSG_DRIVE, REFUSED_EXPIRED);
    assert_int_equal(rig.robot.drive.target_q4[DRIVE_LEFT], target_q4);
    assert_int_equal(rig.robot.drive_seq, seq);
}

static void after_a_stop_driving_begins_as_if_for_the_first_time(void **state)
{
    (void)state;
    tell_drive(500, 0);
    ticks(1);
    int16_t first = rig.hal.duty[DRIVE_LEFT];
    ticks(30);
    assert_true(rig.hal.duty[DRIVE_LEFT] > 2 * first);
    tell(MSG_STOP, (const uint8_t[]){STOP_BRAKE}, MSG_STOP_SIZE);
    tell_drive(500, 0);
    ticks(1);
    assert_int_equal(rig.hal.duty[DRIVE_LEFT], first);
}

static void a_repeated_drive_is_not_obeyed_twice(void **state)
{
    (void)state;
    uint8_t seq = rig.seq;
    for (int i = 0; i < 60; i++) {
        rig.seq = seq; // a babbling repeater
        tell_drive(200, 0);
        ticks(1);
    }
    expect_motors_off();
    assert_int_equal(latest_telemetry().fault, FAULT_LINK_LOST);
}

// --- Requests --------------------------------------------------------------------------------------

static void expect_request(uint16_t request, uint8_t outcome, uint8_t reason)
{
    ticks(2); // telemetry comes with every second one
    struct msg_telemetry telemetry = latest_telemetry();
    assert_int_equal(telemetry.request, request);
    assert_int_equal(telemetry.outcome, outcome);
    assert_int_equal(telemetry.reason, reason);
}

static void expect_param_value(uint8_t param, int32_t value)
{
    uint8_t payload[64];
    struct msg_param_value told;
    expect_heard(MSG_PARAM_VALUE, payload);
    msg_param_value_decode(&told, payload);
    assert_int_equal(told.param, param);
    assert_int_equal(told.value, value);
}

static int moving(void **state)
{
    session(state);
    tell_move(NONCE, 1, 500, 200, DEAD_MAN_US);
    ticks(10);
    return 0;
}

static void before_any_request_there_is_none(void **state)
{
    (void)state;
    expect_request(0, OUTCOME_NONE, REFUSED_NONE);
}

static void a_move_runs_and_is_told_to_run(void **state)
{
    (void)state;
    assert_true(rig.hal.duty[DRIVE_LEFT] > 0);
    assert_true(rig.hal.duty[DRIVE_RIGHT] > 0);
    assert_int_equal(rig.robot.supervisor.state, STATE_MOVING);
    expect_request(1, OUTCOME_RUNNING, REFUSED_NONE);
}

static void a_turn_to_the_right_drives_only_the_left_wheel_forward(void **state)
{
    (void)state;
    tell_turn(NONCE, 1, 1571, 1000);
    ticks(10);
    assert_true(rig.hal.duty[DRIVE_LEFT] > 0);
    assert_true(rig.hal.duty[DRIVE_RIGHT] < 0);
    expect_request(1, OUTCOME_RUNNING, REFUSED_NONE);
}

static void a_move_of_nothing_is_done_when_the_wheels_stand(void **state)
{
    (void)state;
    tell_move(NONCE, 1, 0, 200, DEAD_MAN_US);
    for (int tick = 0; tick < 100 && rig.robot.supervisor.state == STATE_MOVING; tick++) {
        tell_keep_alive(DEAD_MAN_US);
        ticks(1);
    }
    expect_motors_off();
    assert_int_equal(rig.robot.supervisor.state, STATE_READY);
    expect_request(1, OUTCOME_DONE, REFUSED_NONE);
}

static void a_repeated_request_is_not_done_again_and_not_complained_of(void **state)
{
    (void)state;
    uint8_t payload[64];
    int32_t way_um = rig.robot.move.way_um;
    rig.read = rig.hal.uart_size;
    tell_move(NONCE, 1, 900, 100, DEAD_MAN_US);
    assert_int_equal(hear(payload), 0);
    assert_int_equal(rig.robot.move.way_um, way_um);
    tell_stop(STOP_BRAKE);
    ticks(200);
    tell_move(NONCE, 1, 500, 200, DEAD_MAN_US); // nor when it has ended
    ticks(1);
    expect_motors_off();
    expect_request(1, OUTCOME_ABORTED, REFUSED_BY_STOP);
}

static void an_older_request_and_one_for_another_start_leave_no_trace(void **state)
{
    (void)state;
    tell_param_write(NONCE, 0xFFFF, PARAM_SPEED_MAX_MM_S, 100);
    expect_nack(MSG_PARAM_WRITE, REFUSED_OLD_REQUEST);
    tell_param_save(NONCE ^ 1, 2);
    expect_nack(MSG_PARAM_SAVE, REFUSED_BAD_NONCE);
    tell_move(NONCE ^ 1, 2, 500, 200, DEAD_MAN_US);
    expect_nack(MSG_MOVE, REFUSED_BAD_NONCE);
    tell_turn(NONCE ^ 1, 2, 500, 200);
    expect_nack(MSG_TURN, REFUSED_BAD_NONCE);
    expect_request(1, OUTCOME_RUNNING, REFUSED_NONE);
}

static void without_a_session_nothing_is_taken(void **state)
{
    (void)state;
    tell_move(NONCE, 1, 500, 200, DEAD_MAN_US);
    expect_nack(MSG_MOVE, REFUSED_NO_SESSION);
    tell_param_write(NONCE, 1, PARAM_SPEED_MAX_MM_S, 100);
    expect_nack(MSG_PARAM_WRITE, REFUSED_NO_SESSION);
    tell_param_read(PARAM_SPEED_MAX_MM_S);
    expect_nack(MSG_PARAM_READ, REFUSED_NO_SESSION);
    expect_request(0, OUTCOME_NONE, REFUSED_NONE);
}

static void a_move_is_refused_with_its_reason_and_its_number_is_spent(void **state)
{
    (void)state;
    tell_move(NONCE, 1, 500, 0, DEAD_MAN_US);
    expect_nack(MSG_MOVE, REFUSED_BAD_VALUE);
    tell_turn(NONCE, 2, 500, 0);
    expect_nack(MSG_TURN, REFUSED_BAD_VALUE);
    tell_move(NONCE, 3, 500, 200, 0);
    expect_nack(MSG_MOVE, REFUSED_EXPIRED);
    tell_move(NONCE, 4, 500, 200, DRIVE_AHEAD_MAX_US + 1);
    expect_nack(MSG_MOVE, REFUSED_BAD_VALUE);
    expect_request(4, OUTCOME_REFUSED, REFUSED_BAD_VALUE);
    tell(MSG_ESTOP, NULL, 0);
    tell_move(NONCE, 5, 500, 200, DEAD_MAN_US);
    expect_nack(MSG_MOVE, REFUSED_FAULT_LATCHED);
    expect_request(5, OUTCOME_REFUSED, REFUSED_FAULT_LATCHED);
}

static void a_second_move_is_not_taken_and_the_first_goes_on(void **state)
{
    (void)state;
    tell_move(NONCE, 2, 100, 100, DEAD_MAN_US);
    expect_nack(MSG_MOVE, REFUSED_BUSY);
    assert_int_equal(rig.robot.supervisor.state, STATE_MOVING);
    expect_request(1, OUTCOME_RUNNING, REFUSED_NONE);
    tell_stop(STOP_BRAKE);
    expect_request(1, OUTCOME_ABORTED, REFUSED_BY_STOP);
}

static void a_move_brakes_at_its_deadline_and_goes_on_when_kept_alive(void **state)
{
    (void)state;
    tell_keep_alive(20000);
    ticks(3);
    assert_true(rig.hal.duty[DRIVE_LEFT] > 0);
    ticks(1);
    expect_motors_off();
    expect_request(1, OUTCOME_RUNNING, REFUSED_NONE);
    tell_keep_alive(DEAD_MAN_US);
    ticks(1);
    assert_true(rig.hal.duty[DRIVE_LEFT] > 0);
}

static void a_move_without_keep_alive_ends_in_link_lost(void **state)
{
    (void)state;
    ticks(40);
    expect_motors_off();
    assert_int_equal(rig.robot.supervisor.fault, FAULT_LINK_LOST);
    expect_request(1, OUTCOME_ABORTED, REFUSED_BY_FAULT);
}

static void a_keep_alive_that_came_too_late_is_refused(void **state)
{
    (void)state;
    tell_keep_alive((uint32_t)-1000);
    expect_nack(MSG_KEEP_ALIVE, REFUSED_EXPIRED);
}

static void a_keep_alive_when_nothing_moves_is_nothing(void **state)
{
    (void)state;
    uint8_t payload[64];
    rig.read = rig.hal.uart_size;
    tell_keep_alive(DEAD_MAN_US);
    assert_int_equal(hear(payload), 0);
    ticks(1);
    expect_motors_off();
}

static void what_ends_a_move_is_told(void **state)
{
    tell_stop(STOP_BRAKE);
    expect_motors_off();
    expect_request(1, OUTCOME_ABORTED, REFUSED_BY_STOP);
    moving(state);
    tell_drive(200, 0);
    expect_request(1, OUTCOME_ABORTED, REFUSED_BY_DRIVE);
    assert_int_equal(rig.robot.supervisor.state, STATE_DRIVING);
    moving(state);
    tell(MSG_ESTOP, NULL, 0);
    expect_motors_off();
    expect_request(1, OUTCOME_ABORTED, REFUSED_BY_FAULT);
    moving(state);
    tell_hello(SCHEMA_HASH ^ 1u);
    expect_motors_off();
    expect_request(1, OUTCOME_ABORTED, REFUSED_NO_SESSION);
}

static void stop_may_let_the_wheels_roll(void **state)
{
    (void)state;
    tell_stop(STOP_COAST);
    assert_true(rig.hal.coasting[DRIVE_LEFT] && rig.hal.coasting[DRIVE_RIGHT]);
    ticks(200);
    assert_true(rig.hal.coasting[DRIVE_LEFT]);
    tell_stop(STOP_BRAKE);
    assert_false(rig.hal.coasting[DRIVE_LEFT]);
    tell_stop(STOP_COAST);
    tell(MSG_ESTOP, NULL, 0);
    assert_false(rig.hal.coasting[DRIVE_LEFT]);
    expect_motors_off();
}

// --- Parameters ------------------------------------------------------------------------------------

static void a_parameter_is_told_when_asked_for(void **state)
{
    (void)state;
    tell_param_read(PARAM_TRACK_UM);
    expect_param_value(PARAM_TRACK_UM, 150000);
    tell_param_read(PARAM_COUNT);
    expect_nack(MSG_PARAM_READ, REFUSED_BAD_VALUE);
}

static void a_parameter_written_is_told_and_takes_effect_at_once(void **state)
{
    (void)state;
    turn(DRIVE_LEFT, 9);
    ticks(1);
    tell_param_write(NONCE, 1, PARAM_SPEED_MAX_MM_S, 100);
    expect_param_value(PARAM_SPEED_MAX_MM_S, 100);
    expect_request(1, OUTCOME_DONE, REFUSED_NONE);
    tell_drive(500, 0);
    assert_int_equal(rig.robot.drive.target_q4[DRIVE_LEFT], 1600);
    ticks(2);
    assert_int_equal(latest_telemetry().count_left, 9); // counts go on
}

static void a_repeated_write_is_answered_and_not_done_again(void **state)
{
    (void)state;
    tell_param_write(NONCE, 1, PARAM_SPEED_MAX_MM_S, 100);
    expect_param_value(PARAM_SPEED_MAX_MM_S, 100);
    tell_param_write(NONCE, 1, PARAM_SPEED_MAX_MM_S, 200);
    expect_param_value(PARAM_SPEED_MAX_MM_S, 100);
    expect_request(1, OUTCOME_DONE, REFUSED_NONE);
}

static void a_write_out_of_range_changes_nothing(void **state)
{
    (void)state;
    tell_param_write(NONCE, 1, PARAM_SPEED_MAX_MM_S, 5000);
    expect_nack(MSG_PARAM_WRITE, REFUSED_BAD_VALUE);
    expect_request(1, OUTCOME_REFUSED, REFUSED_BAD_VALUE);
    tell_param_write(NONCE, 2, PARAM_COUNT, 1);
    expect_nack(MSG_PARAM_WRITE, REFUSED_BAD_VALUE);
    tell_param_write(NONCE, 2, PARAM_COUNT, 1); // a repetition of it, without a NACK
    expect_request(2, OUTCOME_REFUSED, REFUSED_BAD_VALUE);
    tell_param_read(PARAM_SPEED_MAX_MM_S);
    expect_param_value(PARAM_SPEED_MAX_MM_S, 600);
}

static void while_driving_or_moving_no_parameter_changes(void **state)
{
    tell_param_write(NONCE, 1, PARAM_SPEED_MAX_MM_S, 100);
    expect_nack(MSG_PARAM_WRITE, REFUSED_NOT_STANDING);
    tell_param_save(NONCE, 2);
    expect_nack(MSG_PARAM_SAVE, REFUSED_NOT_STANDING);
    moving(state);
    tell_param_write(NONCE, 2, PARAM_SPEED_MAX_MM_S, 100);
    expect_nack(MSG_PARAM_WRITE, REFUSED_BUSY);
    assert_int_equal(params_get(&rig.robot.params, PARAM_SPEED_MAX_MM_S), 600);
}

static void a_parameter_may_change_in_a_fault_once_the_wheels_stand(void **state)
{
    (void)state;
    turn(DRIVE_LEFT, 1);
    ticks(1);
    turn(DRIVE_LEFT, 1);
    ticks(1);
    tell(MSG_ESTOP, NULL, 0);
    tell_param_write(NONCE, 1, PARAM_SPEED_MAX_MM_S, 100);
    expect_nack(MSG_PARAM_WRITE, REFUSED_NOT_STANDING);
    ticks(200);
    tell_param_write(NONCE, 2, PARAM_SPEED_MAX_MM_S, 100);
    expect_param_value(PARAM_SPEED_MAX_MM_S, 100);
}

static void restart(void)
{
    rig.hal.eeprom_busy = 0;
    rig.seq = 0;
    robot_init(&rig.robot, &rig.hal);
    tell_hello(SCHEMA_HASH);
}

static void saved_parameters_are_there_after_a_restart(void **state)
{
    (void)state;
    tell_param_write(NONCE, 1, PARAM_BATTERY_MIN_MV, 7000);
    tell_param_save(NONCE, 2);
    expect_request(2, OUTCOME_RUNNING, REFUSED_NONE);
    tell_param_save(NONCE, 2); // again, which is nothing
    tell_param_write(NONCE, 3, PARAM_TRACK_UM, 160000);
    expect_nack(MSG_PARAM_WRITE, REFUSED_BUSY);
    tell_move(NONCE, 4, 100, 100, DEAD_MAN_US);
    expect_nack(MSG_MOVE, REFUSED_BUSY);
    expect_request(2, OUTCOME_RUNNING, REFUSED_NONE); // they were not taken
    ticks(400);
    expect_request(2, OUTCOME_DONE, REFUSED_NONE);
    tell_param_write(NONCE, 5, PARAM_TRACK_UM, 160000);
    tell_param_save(NONCE, 6);
    ticks(400);
    expect_request(6, OUTCOME_DONE, REFUSED_NONE);
    restart();
    assert_int_equal(params_get(&rig.robot.params, PARAM_BATTERY_MIN_MV), 7000);
    assert_int_equal(params_get(&rig.robot.params, PARAM_TRACK_UM), 160000);
    assert_int_equal(rig.robot.supervisor.battery_min_mv, 7000);
    assert_int_equal(rig.robot.drive.limits.track_um, 160000);
}

static void what_the_eeprom_does_not_keep_is_told(void **state)
{
    (void)state;
    rig.hal.eeprom_stuck = true;
    tell_param_save(NONCE, 1);
    ticks(400);
    expect_request(1, OUTCOME_ABORTED, REFUSED_NOT_STORED);
}

static void without_a_save_a_restart_forgets(void **state)
{
    (void)state;
    tell_param_write(NONCE, 1, PARAM_TRACK_UM, 160000);
    restart();
    assert_int_equal(params_get(&rig.robot.params, PARAM_TRACK_UM), 150000);
}

// --- Watchdog and watch ----------------------------------------------------------------------------

static void a_start_after_a_hang_waits_for_clear(void **state)
{
    (void)state;
    rig.hal.reset_cause = RESET_WATCHDOG;
    restart();
    ticks(2);
    assert_int_equal(latest_telemetry().fault, FAULT_WATCHDOG);
    tell_drive(200, 0);
    ticks(1);
    expect_motors_off();
    tell_clear(NONCE);
    tell_drive(200, 0);
    ticks(1);
    assert_true(rig.hal.duty[DRIVE_LEFT] > 0);
}

static void a_late_tick_is_a_fault(void **state)
{
    (void)state;
    rig.now_us += 3 * ROBOT_TICK_US;
    ticks(1);
    expect_motors_off();
    assert_int_equal(rig.robot.supervisor.fault, FAULT_OVERRUN);
}

static void wheels_that_do_not_turn_are_a_stall(void **state)
{
    (void)state;
    for (int tick = 0; tick < 200; tick++) {
        tell_drive(300, 0);
        ticks(1);
        rig.hal.uart_size = rig.read = 0;
    }
    expect_motors_off();
    assert_int_equal(rig.robot.supervisor.fault, FAULT_STALL);
}

// --- Tick ------------------------------------------------------------------------------------------

static void omega_to_the_right_drives_the_left_wheel_harder(void **state)
{
    (void)state;
    tell_drive(0, 1000);
    ticks(10);
    assert_true(rig.hal.duty[DRIVE_LEFT] > 0);
    assert_true(rig.hal.duty[DRIVE_RIGHT] < 0);
}

static void the_start_is_a_ramp(void **state)
{
    (void)state;
    tell_drive(500, 0);
    int16_t before = 0;
    for (int tick = 0; tick < 20; tick++) {
        ticks(1);
        assert_in_range(rig.hal.duty[DRIVE_LEFT] - before, tick < 6 ? 0 : 1, 3000); // until the first edge it is wary
        before = rig.hal.duty[DRIVE_LEFT];
    }
}

static void silence_turns_the_motors_off_by_200_ms(void **state)
{
    (void)state;
    tell_drive(200, 0);
    ticks(38);
    assert_true(rig.hal.duty[DRIVE_LEFT] > 0);
    ticks(1);
    expect_motors_off();
    ticks(1);
    assert_int_equal(latest_telemetry().fault, FAULT_LINK_LOST);
    tell_clear(NONCE);
    ticks(1);
    expect_motors_off(); // the old setpoint and its ramp are gone
}

static void the_button_works_without_a_link(void **state)
{
    (void)state;
    rig.hal.estop_pressed = true;
    ticks(1);
    expect_motors_off();
    ticks(1);
    assert_int_equal(latest_telemetry().fault, FAULT_ESTOP_BUTTON);
}

static void telemetry_leaves_100_times_a_second_and_link_status_5_times(void **state)
{
    (void)state;
    uint8_t payload[64];
    unsigned heard[256] = {0};
    for (int tick = 0; tick < 200; tick++) {
        ticks(1);
        rig.hal.uart_room = UINT16_MAX;
        for (uint8_t id = hear(payload); id != 0; id = hear(payload))
            heard[id]++;
        rig.hal.uart_size = rig.read = 0;
    }
    assert_int_equal(heard[MSG_TELEMETRY], 100);
    assert_int_equal(heard[MSG_LINK_STATUS], 5);
}

static void telemetry_tells_what_holds_at_its_time(void **state)
{
    (void)state;
    turn(DRIVE_LEFT, 7);
    turn(DRIVE_RIGHT, -3);
    robot_encoder_edge(&rig.robot, DRIVE_RIGHT, rig.hal.pins[DRIVE_RIGHT] ^ 3, 0);
    tell_drive(200, 1000);
    ticks(2);
    struct msg_telemetry telemetry = latest_telemetry();
    assert_int_equal(telemetry.mcu_time_us, rig.now_us);
    assert_int_equal(telemetry.state, STATE_DRIVING);
    assert_int_equal(telemetry.fault, FAULT_NONE);
    assert_int_equal(telemetry.count_left, 7);
    assert_int_equal(telemetry.count_right, -3);
    assert_int_equal(telemetry.edge_age_left_us, 2 * ROBOT_TICK_US);
    assert_int_equal(telemetry.illegal_left, 0);
    assert_int_equal(telemetry.illegal_right, 1);
    assert_int_equal(telemetry.duty_left_permille, rig.hal.duty[DRIVE_LEFT] * 1000 / 32767);
    assert_int_equal(telemetry.duty_right_permille, rig.hal.duty[DRIVE_RIGHT] * 1000 / 32767);
    assert_int_equal(telemetry.battery_mv, 7400);
    assert_int_equal(telemetry.boot_nonce, NONCE);
    assert_int_equal(telemetry.drive_seq, (uint8_t)(rig.seq - 1));
}

static void a_full_transmit_buffer_costs_messages_and_nothing_else(void **state)
{
    (void)state;
    uint8_t payload[64];
    struct msg_link_status status;
    rig.read = rig.hal.uart_size;
    rig.hal.uart_room = 0;
    tell_drive(200, 0);
    ticks(10);
    assert_true(rig.hal.duty[DRIVE_LEFT] > 0);
    assert_int_equal(hear(payload), 0);
    rig.hal.uart_room = UINT16_MAX;
    rig.hal.uart_lost = 77;
    ticks(30);
    expect_heard(MSG_LINK_STATUS, payload);
    msg_link_status_decode(&status, payload);
    assert_int_equal(status.tx_dropped, 5);
    assert_int_equal(status.rx_overrun, 77);
}

static void interrupts_are_on_again_after_every_tick(void **state)
{
    (void)state;
    ticks(10);
    assert_int_equal(rig.hal.interrupts_off, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(the_motors_are_off_before_anything_else_happens, start),
        cmocka_unit_test_setup(hello_is_said_unasked_after_a_start, start),
        cmocka_unit_test_setup(a_wheel_standing_at_any_pins_starts_with_no_count_and_no_fault, start),
        cmocka_unit_test_setup(hello_is_answered_and_opens_the_way_to_driving, start),
        cmocka_unit_test_setup(a_foreign_host_hears_who_this_is_and_that_it_was_refused, start),
        cmocka_unit_test_setup(ping_is_answered_with_its_own_number_and_the_time_it_came, start),
        cmocka_unit_test_setup(the_last_byte_of_an_estop_has_zeroed_the_motors, driving),
        cmocka_unit_test_setup(an_estop_between_the_parts_of_a_tick_is_obeyed_and_reported, driving),
        cmocka_unit_test_setup(a_drive_between_the_parts_of_a_tick_is_not_taken_for_an_old_one, driving),
        cmocka_unit_test_setup(an_estop_needs_no_session_and_no_order, driving),
        cmocka_unit_test_setup(clear_with_the_right_nonce_allows_driving_again, driving),
        cmocka_unit_test_setup(stop_brakes_at_once, driving),
        cmocka_unit_test_setup(a_refused_drive_changes_nothing, driving),
        cmocka_unit_test_setup(after_a_stop_driving_begins_as_if_for_the_first_time, session),
        cmocka_unit_test_setup(a_repeated_drive_is_not_obeyed_twice, session),
        cmocka_unit_test_setup(before_any_request_there_is_none, session),
        cmocka_unit_test_setup(a_move_runs_and_is_told_to_run, moving),
        cmocka_unit_test_setup(a_turn_to_the_right_drives_only_the_left_wheel_forward, session),
        cmocka_unit_test_setup(a_move_of_nothing_is_done_when_the_wheels_stand, session),
        cmocka_unit_test_setup(a_repeated_request_is_not_done_again_and_not_complained_of, moving),
        cmocka_unit_test_setup(an_older_request_and_one_for_another_start_leave_no_trace, moving),
        cmocka_unit_test_setup(without_a_session_nothing_is_taken, start),
        cmocka_unit_test_setup(a_move_is_refused_with_its_reason_and_its_number_is_spent, session),
        cmocka_unit_test_setup(a_second_move_is_not_taken_and_the_first_goes_on, moving),
        cmocka_unit_test_setup(a_move_brakes_at_its_deadline_and_goes_on_when_kept_alive, moving),
        cmocka_unit_test_setup(a_move_without_keep_alive_ends_in_link_lost, moving),
        cmocka_unit_test_setup(a_keep_alive_that_came_too_late_is_refused, moving),
        cmocka_unit_test_setup(a_keep_alive_when_nothing_moves_is_nothing, session),
        cmocka_unit_test_setup(what_ends_a_move_is_told, moving),
        cmocka_unit_test_setup(stop_may_let_the_wheels_roll, driving),
        cmocka_unit_test_setup(a_parameter_is_told_when_asked_for, session),
        cmocka_unit_test_setup(a_parameter_written_is_told_and_takes_effect_at_once, session),
        cmocka_unit_test_setup(a_repeated_write_is_answered_and_not_done_again, session),
        cmocka_unit_test_setup(a_write_out_of_range_changes_nothing, session),
        cmocka_unit_test_setup(while_driving_or_moving_no_parameter_changes, driving),
        cmocka_unit_test_setup(a_parameter_may_change_in_a_fault_once_the_wheels_stand, session),
        cmocka_unit_test_setup(saved_parameters_are_there_after_a_restart, session),
        cmocka_unit_test_setup(what_the_eeprom_does_not_keep_is_told, session),
        cmocka_unit_test_setup(without_a_save_a_restart_forgets, session),
        cmocka_unit_test_setup(a_start_after_a_hang_waits_for_clear, start),
        cmocka_unit_test_setup(a_late_tick_is_a_fault, driving),
        cmocka_unit_test_setup(wheels_that_do_not_turn_are_a_stall, session),
        cmocka_unit_test_setup(omega_to_the_right_drives_the_left_wheel_harder, session),
        cmocka_unit_test_setup(the_start_is_a_ramp, session),
        cmocka_unit_test_setup(silence_turns_the_motors_off_by_200_ms, session),
        cmocka_unit_test_setup(the_button_works_without_a_link, driving),
        cmocka_unit_test_setup(telemetry_leaves_100_times_a_second_and_link_status_5_times, session),
        cmocka_unit_test_setup(telemetry_tells_what_holds_at_its_time, session),
        cmocka_unit_test_setup(a_full_transmit_buffer_costs_messages_and_nothing_else, session),
        cmocka_unit_test_setup(interrupts_are_on_again_after_every_tick, start),
    };
    return cmocka_run_group_tests_name("robot", tests, NULL, NULL);
}
