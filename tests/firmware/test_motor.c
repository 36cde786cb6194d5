// Specification of motor.c: feedforward, corrections, limits, battery, and rest.
#include <setjmp.h> // cmocka
#include <stdarg.h> // cmocka
#include <stddef.h> // cmocka
#include <stdint.h> // cmocka

#include <cmocka.h> // the test framework
#include <stdlib.h> // abs

#include "motor.h" // what is specified here

static const struct motor_gains feedforward_only = {
    .static_duty = 2000,
    .velocity_q8 = 512,
    .duty_limit = MOTOR_DUTY_FULL,
};

static const struct motor_gains all_gains = {
    .static_duty = 2000,
    .velocity_q8 = 512,
    .proportional_q8 = 256,
    .integral_q12 = 128,
    .integral_limit = 10000,
    .duty_limit = 30000,
};

static struct motor motor;
static struct encoder encoder;

// Ticks with a wheel that is held: no edge ever comes.
static int16_t held_ticks(int ticks, int16_t setpoint_q4, uint16_t battery_mv)
{
    int16_t duty = 0;
    for (int i = 0; i < ticks; i++) {
        motor_sense(&motor, &encoder);
        duty = motor_update(&motor, setpoint_q4, battery_mv);
    }
    return duty;
}

static void begin(const struct motor_gains *gains)
{
    encoder = (struct encoder){.edge_age_us = ENCODER_NO_EDGE_US, .um_per_count = 5000};
    motor_init(&motor, gains);
    motor_sense(&motor, &encoder);
}

// --- Feedforward -----------------------------------------------------------------------------------

static void a_setpoint_of_zero_is_duty_zero_whatever_the_wheel_does(void **state)
{
    (void)state;
    begin(&all_gains);
    held_ticks(1000, 3000, 0);
    assert_int_equal(held_ticks(1, 0, 0), 0);
    motor.wheel.speed_q12 = -8000 * 256;
    assert_int_equal(motor_update(&motor, 0, 0), 0);
}

static void feedforward_is_friction_plus_slope_and_odd_in_the_setpoint(void **state)
{
    (void)state;
    const struct {
        int16_t setpoint_q4, duty;
    } cases[] = {{1600, 2000 + 2 * 1600}, {-1600, -2000 - 2 * 1600}, {1, 2000 + 2}, {-1, -2000 - 2}};
    for (int i = 0; i < 4; i++) {
        begin(&feedforward_only);
        assert_int_equal(motor_update(&motor, cases[i].setpoint_q4, 0), cases[i].duty);
        assert_int_equal(held_ticks(500, cases[i].setpoint_q4, 0), cases[i].duty); // and nothing is learned
    }
}

static void a_change_of_the_setpoint_asks_for_more_while_it_lasts(void **state)
{
    (void)state;
    struct motor_gains gains = feedforward_only;
    gains.acceleration_q8 = 2560; // 10 a q4 and tick
    begin(&gains);
    assert_int_equal(motor_update(&motor, 80, 0), 2000 + 2 * 80 + 10 * 80);
    assert_int_equal(motor_update(&motor, 160, 0), 2000 + 2 * 160 + 10 * 80);
    assert_int_equal(motor_update(&motor, 160, 0), 2000 + 2 * 160);
    assert_int_equal(motor_update(&motor, 150, 0), 2000 + 2 * 150 - 10 * 10);
    assert_int_equal(motor_update(&motor, -80, 0), -2000 - 2 * 80 - 10 * 80); // as from standstill
}

static void the_duty_never_opposes_the_setpoint(void **state)
{
    (void)state;
    for (int direction = -1; direction <= 1; direction += 2) {
        begin(&all_gains);
        motor_update(&motor, (int16_t)(direction * 8000), 0);
        motor.wheel.speed_q12 = direction * 32000 * 256;
        assert_int_equal(motor_update(&motor, (int16_t)(direction * 160), 0), direction * 2000);
        assert_int_equal(motor.wheel.told_q4, direction); // driven, and not told to turn back
    }
}

// --- Corrections -----------------------------------------------------------------------------------

static void the_proportional_part_answers_an_error_at_once(void **state)
{
    (void)state;
    struct motor_gains gains = feedforward_only;
    gains.proportional_q8 = 256;
    begin(&gains);
    motor.wheel.speed_q12 = 1600 * 256;
    int16_t on_speed = motor_update(&motor, 1600, 0);
    assert_int_equal(on_speed, 2000 + 2 * 1600);
    motor.wheel.speed_q12 = 1500 * 256;
    assert_int_equal(motor_update(&motor, 1600, 0), on_speed + 100);
    motor.wheel.speed_q12 = 1700 * 256;
    assert_int_equal(motor_update(&motor, 1600, 0), on_speed - 100);
}

static void of_a_held_wheel_it_says_nothing(void **state)
{
    (void)state;
    struct motor_gains gains = feedforward_only;
    gains.proportional_q8 = 256;
    begin(&gains);
    assert_int_equal(held_ticks(400, 3200, 0), 2000 + 2 * 3200);
}

static void what_a_wheel_drifts_is_taken_off_what_it_is_told(void **state)
{
    (void)state;
    begin(&all_gains);
    motor.wheel.speed_q12 = 3200 * 256;
    int16_t wary = motor_update(&motor, 3200, 0);
    assert_int_equal(wary, 2000 + 2 * (3200 - WHEEL_DRIFT_Q4)); // until edges tell
    motor.wheel.drift_q12 = -500 * 256;
    assert_int_equal(motor_update(&motor, 3200, 0), 2000 + 2 * (3200 + 500));
}

static void the_integral_stops_at_its_limit_and_before_for_a_wheel_that_is_held(void **state)
{
    (void)state;
    begin(&all_gains);
    held_ticks(4000, 160, 0);
    int16_t duty = held_ticks(1, 160, 0);
    assert_in_range(duty, 2000 + 7500 - 300, 2000 + 7500 + 300); // 3/4 of 10000
    int32_t limit_q4 = 10000 / 2;
    assert_int_equal(motor.wheel.drift_limit_q4, limit_q4);
}

static void a_held_wheel_told_to_go_fast_is_pushed_by_no_integral_at_all(void **state)
{
    (void)state;
    begin(&all_gains);
    int16_t before = held_ticks(40, 6000, 0);
    int32_t drift = motor.wheel.drift_q12;
    assert_int_equal(held_ticks(2000, 6000, 0), before);
    assert_int_equal(motor.wheel.drift_q12, drift);
}

static void what_one_direction_or_drive_taught_is_forgotten_in_the_next(void **state)
{
    (void)state;
    begin(&all_gains);
    held_ticks(500, 1600, 0);
    assert_true(motor.wheel.drift_q12 < 0);
    motor_update(&motor, -1600, 0);
    assert_int_equal(motor.wheel.drift_q12, -WHEEL_DRIFT_Q4 * 256);
    held_ticks(500, -1600, 0);
    motor_release(&motor);
    assert_int_equal(motor.duty, 0);
    assert_int_equal(motor.setpoint_q4, 0);
    assert_int_equal(motor.wheel.told_q4, 0);
    motor_update(&motor, -1600, 0);
    assert_int_equal(motor.wheel.drift_q12, -WHEEL_DRIFT_Q4 * 256);
}

// --- Limits ----------------------------------------------------------------------------------------

static void the_duty_stays_within_its_limit_at_the_worst_of_everything(void **state)
{
    (void)state;
    begin(&all_gains);
    for (int i = 0; i < 1000; i++) {
        motor.wheel.speed_q12 = -32000 * 256;
        assert_int_equal(held_ticks(1, INT16_MAX, 0), 30000);
        assert_true(motor.wheel.full);
        motor.wheel.speed_q12 = 32000 * 256;
        assert_int_equal(held_ticks(1, INT16_MIN, 0), -30000);
        assert_true(motor.wheel.full);
    }
    held_ticks(1, 160, 0);
    assert_false(motor.wheel.full);
}

static void no_gain_and_no_speed_overflows(void **state)
{
    (void)state;
    const struct motor_gains extremes[] = {
        {INT16_MAX, INT16_MAX, INT16_MAX, INT16_MAX, INT16_MAX, INT16_MAX, INT16_MAX, UINT16_MAX},
        {INT16_MAX, 0, INT16_MAX, INT16_MAX, INT16_MAX, INT16_MAX, INT16_MAX, UINT16_MAX},
        {.duty_limit = INT16_MAX, .velocity_q8 = INT16_MAX},
        {0},
    };
    const int16_t setpoints[] = {INT16_MAX, INT16_MIN, 1, -1, 0, INT16_MAX};
    for (int i = 0; i < 4; i++) {
        begin(&extremes[i]);
        for (int k = 0; k < 6; k++) {
            motor.wheel.speed_q12 = (k % 2 ? 32000 : -32000) * 256;
            held_ticks(30, setpoints[k], k % 2 ? 1 : UINT16_MAX);
            assert_true(abs(motor.duty) <= extremes[i].duty_limit);
        }
    }
}

// --- Battery ---------------------------------------------------------------------------------------

static int16_t first_duty(uint16_t full_mv, uint16_t battery_mv)
{
    struct motor_gains gains = feedforward_only;
    gains.battery_full_mv = full_mv;
    begin(&gains);
    return motor_update(&motor, 3200, battery_mv);
}

static void a_low_battery_is_made_up_for_and_a_full_one_taken_back(void **state)
{
    (void)state;
    int duty = 2000 + 2 * 3200;
    assert_int_equal(first_duty(7400, 7400), duty);
    assert_in_range(first_duty(7400, 6600), duty * 74 / 66 - 3, duty * 74 / 66);
    assert_in_range(first_duty(7400, 8400), duty * 74 / 84 - 3, duty * 74 / 84);
    assert_in_range(first_duty(7400, 1000), duty * 3 / 2 - 3, duty * 3 / 2); // and no further
    assert_in_range(first_duty(7400, 30000), duty * 8 / 10 - 3, duty * 8 / 10 + 3);
}

static void without_a_full_voltage_or_a_measured_one_the_duty_is_as_it_is(void **state)
{
    (void)state;
    assert_int_equal(first_duty(0, 6600), 2000 + 2 * 3200);
    assert_int_equal(first_duty(7400, 0), 2000 + 2 * 3200);
}

static void a_battery_that_sags_under_load_is_followed_slowly(void **state)
{
    (void)state;
    int16_t before = first_duty(7400, 7400);
    int16_t next = motor_update(&motor, 3200, 6600);
    assert_in_range(next - before, 0, before / 1000);
    for (int i = 0; i < 400; i++) // 0.12 * 4096 / 2 is 248
        next = motor_update(&motor, 3200, 6600);
    assert_in_range(next, before * 74 / 66 - 10, before * 74 / 66 + 10);
    for (int i = 0; i < 400; i++)
        next = motor_update(&motor, 3200, 7400);
    assert_in_range(next, before - 10, before + 10);
}

static void the_next_drive_begins_with_the_battery_as_it_is_then(void **state)
{
    (void)state;
    first_duty(7400, 7400);
    motor_update(&motor, 0, 7400);
    int duty = 2000 + 2 * 3200;
    assert_in_range(motor_update(&motor, 3200, 6600), duty * 74 / 66 - 3, duty * 74 / 66);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_setpoint_of_zero_is_duty_zero_whatever_the_wheel_does),
        cmocka_unit_test(feedforward_is_friction_plus_slope_and_odd_in_the_setpoint),
        cmocka_unit_test(a_change_of_the_setpoint_asks_for_more_while_it_lasts),
        cmocka_unit_test(the_duty_never_opposes_the_setpoint),
        cmocka_unit_test(the_proportional_part_answers_an_error_at_once),
        cmocka_unit_test(of_a_held_wheel_it_says_nothing),
        cmocka_unit_test(what_a_wheel_drifts_is_taken_off_what_it_is_told),
        cmocka_unit_test(the_integral_stops_at_its_limit_and_before_for_a_wheel_that_is_held),
        cmocka_unit_test(a_held_wheel_told_to_go_fast_is_pushed_by_no_integral_at_all),
        cmocka_unit_test(what_one_direction_or_drive_taught_is_forgotten_in_the_next),
        cmocka_unit_test(the_duty_stays_within_its_limit_at_the_worst_of_everything),
        cmocka_unit_test(no_gain_and_no_speed_overflows),
        cmocka_unit_test(a_low_battery_is_made_up_for_and_a_full_one_taken_back),
        cmocka_unit_test(without_a_full_voltage_or_a_measured_one_the_duty_is_as_it_is),
        cmocka_unit_test(a_battery_that_sags_under_load_is_followed_slowly),
        cmocka_unit_test(the_next_drive_begins_with_the_battery_as_it_is_then),
    };
    return cmocka_run_group_tests_name("motor", tests, NULL, NULL);
}
