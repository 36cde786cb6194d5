// Specification of motor.c: feedforward, PI, limits, anti-windup, and rest.
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

static int16_t after_ticks(int ticks, int16_t setpoint_q4, int16_t speed_q4)
{
    int16_t duty = 0;
    for (int i = 0; i < ticks; i++)
        duty = motor_update(&motor, setpoint_q4, speed_q4, 0);
    return duty;
}

static void a_setpoint_of_zero_is_duty_zero_whatever_the_wheel_does(void **state)
{
    (void)state;
    motor_init(&motor, &all_gains);
    after_ticks(1000, 3000, 0);
    assert_int_equal(motor_update(&motor, 0, 8000, 0), 0);
    assert_int_equal(motor_update(&motor, 0, -8000, 0), 0);
    assert_int_equal(motor.integral_q12, 0);
}

static void feedforward_is_friction_plus_slope_and_odd_in_the_setpoint(void **state)
{
    (void)state;
    motor_init(&motor, &feedforward_only);
    assert_int_equal(motor_update(&motor, 1600, 0, 0), 2000 + 2 * 1600);
    assert_int_equal(motor_update(&motor, -1600, 0, 0), -2000 - 2 * 1600);
    assert_int_equal(motor_update(&motor, 1, 0, 0), 2000 + 2);
}

static void the_proportional_part_answers_an_error_at_once(void **state)
{
    (void)state;
    struct motor_gains gains = feedforward_only;
    gains.proportional_q8 = 256;
    motor_init(&motor, &gains);
    int16_t on_speed = motor_update(&motor, 1600, 1600, 0);
    assert_int_equal(motor_update(&motor, 1600, 1500, 0), on_speed + 100);
    assert_int_equal(motor_update(&motor, 1600, 1700, 0), on_speed - 100);
}

static void the_integral_part_grows_with_error_and_time(void **state)
{
    (void)state;
    struct motor_gains gains = feedforward_only;
    gains.integral_q12 = 128;
    gains.integral_limit = 10000;
    motor_init(&motor, &gains);
    int16_t on_speed = motor_update(&motor, 1600, 1600, 0);
    assert_int_equal(after_ticks(32, 1600, 1500), on_speed + 100);
    assert_int_equal(after_ticks(32, 1600, 1500), on_speed + 200);
    assert_int_equal(after_ticks(64, 1600, 1700), on_speed);
}

static void the_integral_stops_at_its_own_limit(void **state)
{
    (void)state;
    struct motor_gains gains = feedforward_only;
    gains.integral_q12 = 128;
    gains.integral_limit = 3000;
    motor_init(&motor, &gains);
    int16_t on_speed = motor_update(&motor, 1600, 1600, 0);
    assert_int_equal(after_ticks(10000, 1600, 0), on_speed + 3000);
    assert_int_equal(after_ticks(10000, 1600, 3200), on_speed - 3000);
}

static void the_duty_stays_within_its_limit_at_the_worst_of_everything(void **state)
{
    (void)state;
    motor_init(&motor, &all_gains);
    for (int i = 0; i < 1000; i++) {
        assert_int_equal(motor_update(&motor, INT16_MAX, INT16_MIN, 0), 30000);
        assert_int_equal(motor_update(&motor, INT16_MIN, INT16_MAX, 0), -30000);
    }
}

static void no_gain_and_no_speed_overflows(void **state)
{
    (void)state;
    const struct motor_gains extremes[] = {
        {INT16_MAX, INT16_MAX, INT16_MAX, INT16_MAX, INT16_MAX, INT16_MAX, INT16_MAX, 0},
        {.integral_q12 = INT16_MAX, .integral_limit = INT16_MAX, .duty_limit = INT16_MAX},
    };
    for (int i = 0; i < 2; i++) {
        motor_init(&motor, &extremes[i]);
        assert_int_equal(after_ticks(3, INT16_MAX, INT16_MIN), INT16_MAX);
        assert_int_equal(after_ticks(3, -INT16_MAX, INT16_MAX), -INT16_MAX);
    }
}

static void a_long_stall_at_the_limit_does_not_wind_up(void **state)
{
    (void)state;
    motor_init(&motor, &all_gains);
    motor_update(&motor, 12000, 12000, 0);
    int32_t before = motor.integral_q12;
    assert_int_equal(after_ticks(2000, 12000, 0), 30000); // 2000 + 24000 + 12000 is beyond it already
    assert_int_equal(motor.integral_q12, before);
    assert_int_equal(motor_update(&motor, 12000, 12000, 0), 2000 + 24000);
}

static void at_the_limit_the_integral_may_still_come_back(void **state)
{
    (void)state;
    motor_init(&motor, &all_gains);
    after_ticks(200, 10000, 9000); // the integral fills what the limit leaves
    int32_t filled = motor.integral_q12;
    after_ticks(200, 15000, 15100); // 2000 + 30000 and too fast
    assert_true(motor.integral_q12 < filled);
}

static void what_one_direction_taught_is_forgotten_in_the_other(void **state)
{
    (void)state;
    motor_init(&motor, &all_gains);
    after_ticks(500, 1600, 800);
    motor_update(&motor, -1600, -1600, 0);
    assert_int_equal(motor.integral_q12, 0);
    assert_int_equal(motor.duty, -2000 - 3200);
}

static void a_released_motor_starts_like_a_new_one(void **state)
{
    (void)state;
    struct motor fresh;
    motor_init(&fresh, &all_gains);
    motor_init(&motor, &all_gains);
    after_ticks(500, 1600, 800);
    motor_release(&motor);
    assert_int_equal(motor.duty, 0);
    assert_int_equal(motor_update(&motor, 1600, 100, 0), motor_update(&fresh, 1600, 100, 0));
}

// A first-order motor, 0.6 m/s at full duty, which the feedforward believes to be 1 m/s.
static void a_weak_motor_reaches_its_setpoint_and_stays(void **state)
{
    (void)state;
    motor_init(&motor, &all_gains);
    double speed_q4 = 0;
    for (int tick = 0; tick < 1000; tick++) {
        double duty = motor_update(&motor, 3200, (int16_t)speed_q4, 0) / 32767.0;
        speed_q4 += (duty * 600 * 16 - speed_q4) * 5 / 60;
        assert_true(speed_q4 < 3200 * 1.1);
        if (tick >= 800)
            assert_true(abs((int)speed_q4 - 3200) < 16);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_setpoint_of_zero_is_duty_zero_whatever_the_wheel_does),
        cmocka_unit_test(feedforward_is_friction_plus_slope_and_odd_in_the_setpoint),
        cmocka_unit_test(the_proportional_part_answers_an_error_at_once),
        cmocka_unit_test(the_integral_part_grows_with_error_and_time),
        cmocka_unit_test(the_integral_stops_at_its_own_limit),
        cmocka_unit_test(the_duty_stays_within_its_limit_at_the_worst_of_everything),
        cmocka_unit_test(no_gain_and_no_speed_overflows),
        cmocka_unit_test(a_long_stall_at_the_limit_does_not_wind_up),
        cmocka_unit_test(at_the_limit_the_integral_may_still_come_back),
        cmocka_unit_test(what_one_direction_taught_is_forgotten_in_the_other),
        cmocka_unit_test(a_released_motor_starts_like_a_new_one),
        cmocka_unit_test(a_weak_motor_reaches_its_setpoint_and_stays),
    };
    return cmocka_run_group_tests_name("motor", tests, NULL, NULL);
}
