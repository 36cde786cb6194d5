// Specification of wheel.c: place, speed and drift between edges, and where a wheel began.
#include <setjmp.h> // cmocka
#include <stdarg.h> // cmocka
#include <stddef.h> // cmocka
#include <stdint.h> // cmocka

#include <cmocka.h>  // the test framework
#include <stdbool.h> // bool
#include <stdlib.h>  // abs

#include "wheel.h" // what is specified here

// --- A wheel that turns as the test says -----------------------------------------------------------

#define UM_PER_COUNT 5000
#define TICK_S 0.005

static const uint8_t forward_pins[4] = {0, 1, 3, 2}; // (B << 1) | A

static struct {
    struct encoder_edges edges;
    struct encoder encoder;
    struct wheel wheel;
    double began;  // counts from the border below
    double counts; // where it is, from that border
    double speed;  // mm/s
    uint32_t now_us;
} rig;

static void start_at(double counts)
{
    rig.began = rig.counts = counts;
    rig.speed = 0;
    rig.now_us = 1000000;
    encoder_edges_init(&rig.edges, forward_pins[0]);
    encoder_init(&rig.encoder, &rig.edges, UM_PER_COUNT);
    wheel_init(&rig.wheel, 128, 3000);
    encoder_update(&rig.encoder, &rig.edges, rig.now_us);
    wheel_update(&rig.wheel, &rig.encoder);
}

static int fresh(void **state)
{
    (void)state;
    start_at(0.5);
    return 0;
}

static int count_of(double counts)
{
    return (int)(counts + 100000) - 100000;
}

static double size_of(double value)
{
    return value < 0 ? -value : value;
}

// One tick at rig.speed, changing evenly by `gain` mm/s.
static void tick(double gain)
{
    for (int us = 0; us < 5000; us += 20) {
        int before = count_of(rig.counts);
        rig.speed += gain * 20 / 5000;
        rig.counts += rig.speed * 20e-6 / 5;
        rig.now_us += 20;
        if (count_of(rig.counts) != before)
            encoder_edge(&rig.edges, forward_pins[count_of(rig.counts) & 3], (uint16_t)(rig.now_us / 4));
    }
    encoder_update(&rig.encoder, &rig.edges, rig.now_us);
    wheel_update(&rig.wheel, &rig.encoder);
}

static void set_out(int told_mm_s)
{
    wheel_start(&rig.wheel, told_mm_s > 0 ? 1 : -1);
    rig.wheel.told_q4 = (int16_t)(told_mm_s * 16);
}

// For this long turning at this speed, told to.
static void run(int mm_s, double seconds)
{
    rig.wheel.told_q4 = (int16_t)(mm_s * 16);
    rig.speed = mm_s;
    for (int i = 0; i < seconds / TICK_S; i++)
        tick(0);
}

static double true_um(void)
{
    return (rig.counts - rig.began) * UM_PER_COUNT;
}

static double error_um(void)
{
    return wheel_travel_um(&rig.wheel) - true_um();
}

// --- Without edges ---------------------------------------------------------------------------------

static void a_wheel_told_nothing_stands(void **state)
{
    (void)state;
    run(0, 1);
    assert_int_equal(wheel_travel_um(&rig.wheel), 0);
    assert_int_equal(wheel_speed_q4(&rig.wheel), 0);
}

static void it_goes_to_the_speed_told_with_a_lag_of_60_ms(void **state)
{
    (void)state;
    set_out(100);
    for (int i = 0; i < 6; i++)
        tick(0);
    assert_in_range(wheel_speed_q4(&rig.wheel), 1600 * 0.37, 1600 * 0.43); // 1 - exp(-30 / 60)
}

static void braked_it_comes_to_rest_and_does_not_turn_back(void **state)
{
    (void)state;
    for (int direction = -1; direction <= 1; direction += 2) {
        fresh(state);
        set_out(direction * 100);
        for (int i = 0; i < 4; i++)
            tick(0);
        rig.wheel.told_q4 = 0;
        int16_t before = wheel_speed_q4(&rig.wheel);
        for (int i = 0; i < 60; i++) {
            tick(0);
            assert_true(wheel_speed_q4(&rig.wheel) * direction >= 0);
            assert_true(abs(wheel_speed_q4(&rig.wheel)) <= abs(before));
            before = wheel_speed_q4(&rig.wheel);
        }
        assert_int_equal(before, 0);
    }
}

static void no_edge_means_no_more_than_one_count_from_where_it_began(void **state)
{
    (void)state;
    for (int direction = -1; direction <= 1; direction += 2) {
        fresh(state);
        set_out(direction * 300);
        for (int i = 0; i < 400; i++) {
            tick(0);
            assert_in_range(wheel_travel_um(&rig.wheel) * direction, 0, UM_PER_COUNT);
        }
        assert_int_equal(wheel_travel_um(&rig.wheel), direction * UM_PER_COUNT);
    }
}

static void a_wheel_whose_edge_does_not_come_is_slower_than_it_was_taken_to_be(void **state)
{
    (void)state;
    set_out(300);
    for (int i = 0; i < 60; i++)
        tick(0);
    assert_true(rig.wheel.drift_q12 < 0);
    assert_true(wheel_speed_q4(&rig.wheel) < 300 * 16);
}

// --- With edges ------------------------------------------------------------------------------------

static void between_the_edges_of_a_steady_wheel_place_and_speed_are_right(void **state)
{
    const int speeds[] = {30, 100, 300, 1000};
    for (int i = 0; i < 8; i++) {
        int mm_s = i < 4 ? speeds[i] : -speeds[i - 4];
        fresh(state);
        set_out(mm_s);
        run(mm_s, 1.5);
        double origin = error_um(); // where in its count it began it cannot know: it did not start from rest
        for (int t = 0; t < 200; t++) {
            tick(0);
            assert_true(size_of(error_um() - origin) < 150);
            assert_true(abs(wheel_speed_q4(&rig.wheel) - mm_s * 16) <= 16 + abs(mm_s) * 16 / 50);
        }
    }
}

static void right_after_an_edge_it_stands_at_the_border_whichever_way(void **state)
{
    (void)state;
    set_out(200);
    run(200, 0.2);
    run(0, 0.5);
    double origin = 0;
    // To and fro over one border, slowly: the edge says where the wheel is, forward and back.
    for (int i = 0; i < 6; i++) {
        int direction = i % 2 ? 1 : -1;
        int32_t before = rig.encoder.count;
        set_out(direction * 40);
        rig.speed = direction * 40;
        while (rig.encoder.count == before)
            tick(0);
        origin = i == 0 ? error_um() : origin;
        assert_true(size_of(error_um() - origin) < 250); // what it went since the edge is less
    }
}

static void several_edges_in_one_tick_are_followed(void **state)
{
    (void)state;
    set_out(1900);
    run(1900, 0.5);
    double origin = error_um();
    run(1900, 0.5);
    assert_true(size_of(error_um() - origin) < 500);
}

static void counts_go_on_past_16_bits_and_travel_past_32(void **state)
{
    (void)state;
    rig.encoder.um_per_count = 40000;
    set_out(1000);
    run(1000, 0.1);
    int32_t before = rig.encoder.count, before_um = wheel_travel_um(&rig.wheel);
    for (int i = 0; i < 60000; i++) {
        rig.encoder.count += 1 + i % 2; // 3.6 km
        rig.encoder.edge_age_us = 1000;
        wheel_update(&rig.wheel, &rig.encoder);
    }
    uint32_t went = (uint32_t)(rig.encoder.count - before) * 40000u + (uint32_t)before_um;
    assert_true(abs((int32_t)((uint32_t)wheel_travel_um(&rig.wheel) - went)) <= 40000);
}

// --- Drift -----------------------------------------------------------------------------------------

static void until_edges_tell_it_is_taken_to_be_faster_than_told(void **state)
{
    (void)state;
    wheel_start(&rig.wheel, 1);
    assert_int_equal(rig.wheel.drift_q12, WHEEL_DRIFT_Q4 * 256);
    wheel_start(&rig.wheel, -1);
    assert_int_equal(rig.wheel.drift_q12, -WHEEL_DRIFT_Q4 * 256);
    wheel_init(&rig.wheel, 128, 100);
    wheel_start(&rig.wheel, 1);
    assert_int_equal(rig.wheel.drift_q12, 100 * 256);
}

static void a_wheel_faster_than_told_drifts_up_and_a_slower_one_down(void **state)
{
    (void)state;
    for (int sign = -1; sign <= 1; sign += 2) {
        fresh(state);
        set_out(200);
        run(200, 0.5);
        int32_t before = rig.wheel.drift_q12;
        for (int i = 0; i < 600; i++) {
            rig.speed = 200 + sign * 40;
            rig.wheel.told_q4 = 200 * 16;
            int32_t last = rig.wheel.drift_q12;
            tick(0);
            assert_true(abs(rig.wheel.drift_q12) <= 3000 * 256);
            if (i > 20)
                assert_true((rig.wheel.drift_q12 - last) * sign >= 0);
        }
        assert_true((rig.wheel.drift_q12 - before) * sign > 40 * 16 * 256);
    }
}

static void a_motor_at_its_limit_is_not_asked_for_more_but_may_be_for_less(void **state)
{
    (void)state;
    for (int sign = -1; sign <= 1; sign += 2) {
        fresh(state);
        set_out(200);
        run(200, 0.5);
        int32_t before = rig.wheel.drift_q12;
        rig.wheel.full = true;
        for (int i = 0; i < 100; i++) {
            rig.speed = 200 + sign * 60;
            rig.wheel.told_q4 = 200 * 16;
            tick(0);
        }
        if (sign < 0)
            assert_true(rig.wheel.drift_q12 >= before);
        else
            assert_true(rig.wheel.drift_q12 > before + 60 * 16 * 256);
    }
}

static void a_held_wheel_that_is_pushed_hard_is_pushed_no_harder(void **state)
{
    (void)state;
    int32_t drift[2];
    for (int hard = 0; hard < 2; hard++) {
        fresh(state);
        set_out(200);
        rig.wheel.hard = hard;
        for (int i = 0; i < 400; i++)
            tick(0);
        drift[hard] = rig.wheel.drift_q12;
    }
    assert_int_equal(drift[0], -3000 * 256);
    assert_true(drift[1] > -1000 * 256);
}

static void a_wheel_that_comes_loose_runs_as_told_and_its_edge_teaches_nothing(void **state)
{
    (void)state;
    const int told_mm_s[] = {60, -60, 400, -400};
    for (int i = 0; i < 4; i++) {
        fresh(state);
        int direction = told_mm_s[i] > 0 ? 1 : -1;
        set_out(told_mm_s[i]);
        for (int t = 0; t < 200; t++)
            tick(0);
        assert_int_equal(rig.wheel.stuck, WHEEL_STUCK_TICKS);
        int32_t before = rig.wheel.drift_q12;
        rig.wheel.hard = true;
        rig.counts = direction > 0 ? 0.9999 : 0.0001;
        rig.speed = direction * 100;
        tick(0);
        assert_int_equal(wheel_speed_q4(&rig.wheel), i < 2 ? told_mm_s[i] * 16 : direction * 2000);
        assert_int_equal(rig.wheel.drift_q12, before);
        assert_int_equal(rig.wheel.stuck, 0);
    }
}

static void an_edge_against_what_a_held_wheel_was_told_is_no_speed(void **state)
{
    (void)state;
    set_out(100);
    for (int t = 0; t < 200; t++)
        tick(0);
    rig.counts = 0.0001;
    rig.speed = -100;
    tick(0);
    assert_int_equal(wheel_speed_q4(&rig.wheel), 0);
}

// --- Where it began --------------------------------------------------------------------------------

// From rest, as a ramp of 1 m/s^2 would take it, with the lag that the simple motor has.
static void start_from_rest(double began, int direction, double faster)
{
    start_at(began);
    set_out(direction);
    double told = 0;
    for (int i = 0; i < 70; i++) {
        told += told < 300 ? 5 : 0;
        rig.wheel.told_q4 = (int16_t)(direction * told * 16);
        double lead = WHEEL_DRIFT_Q4 / 16.0; // what was taken off for the drift
        double drift = rig.wheel.drift_q12 / 4096.0 * direction - lead, aim = told - lead + faster;
        aim = aim - drift > 0 ? aim - drift : 0;
        tick((direction * aim - rig.speed) * 5 / 60);
    }
}

static void five_edges_from_rest_tell_where_in_its_count_a_wheel_began(void **state)
{
    (void)state;
    double worst = 0;
    for (double began = 0.05; began < 1; began += 0.1)
        for (int direction = -1; direction <= 1; direction += 2)
            for (double faster = -20; faster <= 20; faster += 20) {
                start_from_rest(began, direction, faster);
                worst = size_of(error_um()) > worst ? size_of(error_um()) : worst;
            }
    assert_true(worst < 900); // not knowing, it would be half a count
}

static void a_wheel_turned_by_hand_may_have_begun_anywhere_in_its_count(void **state)
{
    (void)state;
    for (int direction = -1; direction <= 1; direction += 2) {
        fresh(state);
        rig.speed = direction * 100;
        while (rig.encoder.count == 0)
            tick(0);
        assert_true(abs(wheel_travel_um(&rig.wheel) - direction * UM_PER_COUNT / 2) < 400);
        for (int i = 0; i < 100; i++)
            tick(0);
        assert_true(size_of(error_um()) < 1500);
    }
}

static void a_wheel_slow_to_its_first_edge_may_have_begun_anywhere_in_its_count(void **state)
{
    (void)state;
    start_at(0.9);
    set_out(40);
    for (int i = 0; i < 60; i++)
        tick(0); // it does not turn yet
    rig.speed = 40;
    while (rig.encoder.count == 0)
        tick(0);
    assert_true(abs(wheel_travel_um(&rig.wheel) - UM_PER_COUNT / 2) < 400);
}

static void a_first_edge_before_any_speed_came_at_once(void **state)
{
    (void)state;
    start_at(0.999);
    set_out(10);
    rig.wheel.told_q4 = 80;
    tick(0);
    rig.speed = 2;
    for (int i = 0; i < 3; i++)
        tick(0);
    assert_int_equal(rig.encoder.count, 1);
    assert_in_range(wheel_travel_um(&rig.wheel), 0, 50);
}

static void a_turn_back_or_a_new_start_among_the_first_edges_leaves_it_at_what_is_known(void **state)
{
    (void)state;
    for (int turn = 0; turn < 2; turn++) {
        start_at(0.5);
        set_out(100);
        run(100, 0.06);
        int32_t known = rig.wheel.first_um;
        assert_int_equal(rig.encoder.count, 1);
        set_out(turn ? -100 : 100);
        run(turn ? -100 : 100, 0.5);
        assert_int_equal(rig.wheel.first_um, known);
    }
    start_at(0.5);
    set_out(100);
    run(100, 0.06);
    int32_t known = rig.wheel.first_um;
    run(-100, 0.5); // by hand
    assert_int_equal(rig.wheel.first_um, known);
}

static void a_start_without_an_edge_goes_on_from_where_the_last_one_ended(void **state)
{
    (void)state;
    set_out(50);
    for (int i = 0; i < 6; i++)
        tick(0);
    int32_t before = wheel_travel_um(&rig.wheel);
    assert_in_range(before, 1, UM_PER_COUNT);
    wheel_start(&rig.wheel, 1);
    assert_true(abs(wheel_travel_um(&rig.wheel) - before) <= 1);
}

static void a_new_wheel_takes_its_place_from_an_encoder_that_has_counted(void **state)
{
    (void)state;
    for (int direction = -1; direction <= 1; direction += 2) {
        fresh(state);
        set_out(direction * 100);
        run(direction * 100, 1);
        run(0, 1);
        wheel_init(&rig.wheel, 128, 3000);
        double before = rig.counts;
        tick(0);
        assert_int_equal(wheel_travel_um(&rig.wheel), 0);
        set_out(direction * 100);
        run(direction * 100, 0.5);
        double way_um = (rig.counts - before) * UM_PER_COUNT;
        assert_true(size_of(wheel_travel_um(&rig.wheel) - way_um) < UM_PER_COUNT);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_wheel_told_nothing_stands, fresh),
        cmocka_unit_test_setup(it_goes_to_the_speed_told_with_a_lag_of_60_ms, fresh),
        cmocka_unit_test_setup(braked_it_comes_to_rest_and_does_not_turn_back, fresh),
        cmocka_unit_test_setup(no_edge_means_no_more_than_one_count_from_where_it_began, fresh),
        cmocka_unit_test_setup(a_wheel_whose_edge_does_not_come_is_slower_than_it_was_taken_to_be, fresh),
        cmocka_unit_test_setup(between_the_edges_of_a_steady_wheel_place_and_speed_are_right, fresh),
        cmocka_unit_test_setup(right_after_an_edge_it_stands_at_the_border_whichever_way, fresh),
        cmocka_unit_test_setup(several_edges_in_one_tick_are_followed, fresh),
        cmocka_unit_test_setup(counts_go_on_past_16_bits_and_travel_past_32, fresh),
        cmocka_unit_test_setup(until_edges_tell_it_is_taken_to_be_faster_than_told, fresh),
        cmocka_unit_test_setup(a_wheel_faster_than_told_drifts_up_and_a_slower_one_down, fresh),
        cmocka_unit_test_setup(a_motor_at_its_limit_is_not_asked_for_more_but_may_be_for_less, fresh),
        cmocka_unit_test_setup(a_held_wheel_that_is_pushed_hard_is_pushed_no_harder, fresh),
        cmocka_unit_test_setup(a_wheel_that_comes_loose_runs_as_told_and_its_edge_teaches_nothing, fresh),
        cmocka_unit_test_setup(an_edge_against_what_a_held_wheel_was_told_is_no_speed, fresh),
        cmocka_unit_test_setup(five_edges_from_rest_tell_where_in_its_count_a_wheel_began, fresh),
        cmocka_unit_test_setup(a_wheel_turned_by_hand_may_have_begun_anywhere_in_its_count, fresh),
        cmocka_unit_test_setup(a_wheel_slow_to_its_first_edge_may_have_begun_anywhere_in_its_count, fresh),
        cmocka_unit_test_setup(a_first_edge_before_any_speed_came_at_once, fresh),
        cmocka_unit_test_setup(a_turn_back_or_a_new_start_among_the_first_edges_leaves_it_at_what_is_known, fresh),
        cmocka_unit_test_setup(a_start_without_an_edge_goes_on_from_where_the_last_one_ended, fresh),
        cmocka_unit_test_setup(a_new_wheel_takes_its_place_from_an_encoder_that_has_counted, fresh),
    };
    return cmocka_run_group_tests_name("wheel", tests, NULL, NULL);
}
