// Specification of encoder.c: counting, faults of the signal, and speed.
#include <setjmp.h> // cmocka
#include <stdarg.h> // cmocka
#include <stddef.h> // cmocka
#include <stdint.h> // cmocka

#include <cmocka.h> // the test framework
#include <stdlib.h> // abs

#include "encoder.h" // what is specified here

// --- A wheel turned by hand ------------------------------------------------------------------------

#define TICK_US 5000

static const uint8_t forward_pins[4] = {0, 1, 3, 2}; // (B << 1) | A

static struct {
    struct encoder_edges edges;
    struct encoder encoder;
    int32_t position; // true counts
    uint32_t now_us;
    uint32_t tick_us; // of the next update
} rig;

static void start_with_pins_of(int32_t position)
{
    rig.position = position;
    encoder_edges_init(&rig.edges, forward_pins[position & 3]);
    encoder_init(&rig.encoder, &rig.edges, 5000);
    rig.now_us = 1000000;
    rig.tick_us = rig.now_us + TICK_US;
}

static int fresh(void **state)
{
    (void)state;
    start_with_pins_of(0);
    return 0;
}

static void pass(uint32_t us)
{
    uint32_t until = rig.now_us + us;
    while ((int32_t)(until - rig.tick_us) >= 0) {
        encoder_update(&rig.encoder, &rig.edges, rig.tick_us);
        rig.tick_us += TICK_US;
    }
    rig.now_us = until;
}

static void pins(uint8_t levels)
{
    encoder_edge(&rig.edges, levels, (uint16_t)(rig.now_us / ENCODER_STAMP_US));
}

static void turn(int32_t counts)
{
    for (; counts > 0; counts--)
        pins(forward_pins[++rig.position & 3]);
    for (; counts < 0; counts++)
        pins(forward_pins[--rig.position & 3]);
}

// Each edge comes in the middle of its time, so that one call continues another evenly.
static void turn_steadily(int32_t counts, uint32_t us_per_count)
{
    for (int32_t i = 0; i < abs(counts); i++) {
        pass(us_per_count / 2);
        turn(counts > 0 ? 1 : -1);
        pass(us_per_count - us_per_count / 2);
    }
}

static void expect_speed(int mm_s, int tolerance_q4)
{
    assert_in_range(rig.encoder.speed_q4 + 100000, mm_s * 16 - tolerance_q4 + 100000,
                    mm_s * 16 + tolerance_q4 + 100000);
}

// --- Counting --------------------------------------------------------------------------------------

static void a_full_cycle_is_four_counts_either_way(void **state)
{
    (void)state;
    turn(4);
    pass(TICK_US);
    assert_int_equal(rig.encoder.count, 4);
    assert_int_equal(rig.encoder.direction, 1);
    turn(-9);
    pass(TICK_US);
    assert_int_equal(rig.encoder.count, -5);
    assert_int_equal(rig.encoder.direction, -1);
    assert_int_equal(rig.encoder.illegal, 0);
}

static void starting_at_any_pins_makes_no_false_edge(void **state)
{
    (void)state;
    for (int32_t position = 0; position < 4; position++) {
        start_with_pins_of(position);
        pins(forward_pins[position]);
        pass(TICK_US);
        assert_int_equal(rig.encoder.count, 0);
        assert_int_equal(rig.encoder.illegal, 0);
        turn(1);
        pass(TICK_US);
        assert_int_equal(rig.encoder.count, 1);
    }
}

static void an_interrupt_without_a_change_changes_nothing(void **state)
{
    (void)state;
    turn(3);
    struct encoder_edges before = rig.edges;
    rig.now_us += 100;
    pins(forward_pins[3]);
    assert_memory_equal(&rig.edges, &before, sizeof before);
}

static void both_pins_at_once_is_counted_as_a_fault_and_not_as_travel(void **state)
{
    (void)state;
    for (int i = 0; i < 300; i++) {
        pins(i % 2 ? 0 : 3);
        pass(TICK_US);
    }
    assert_int_equal(rig.encoder.count, 0);
    assert_int_equal(rig.encoder.illegal, 300);
    turn(5);
    pass(TICK_US);
    assert_int_equal(rig.encoder.count, 5);
}

static void counts_go_on_past_the_eight_bits_of_the_interrupt(void **state)
{
    (void)state;
    for (int i = 0; i < 100; i++) {
        turn(127);
        pass(TICK_US);
    }
    assert_int_equal(rig.encoder.count, 12700);
    for (int i = 0; i < 200; i++) {
        turn(-127);
        pass(TICK_US);
    }
    assert_int_equal(rig.encoder.count, -12700);
}

static void bouncing_on_an_edge_adds_nothing(void **state)
{
    (void)state;
    for (int i = 0; i < 1000; i++) {
        turn(i % 2 ? -1 : 1);
        pass(700);
    }
    assert_int_equal(rig.encoder.count, 0);
    assert_int_equal(rig.encoder.illegal, 0);
    expect_speed(0, 0);
}

// --- Age of the last edge --------------------------------------------------------------------------

static void the_age_runs_from_the_edge_itself_and_not_from_the_tick(void **state)
{
    (void)state;
    assert_int_equal(rig.encoder.edge_age_us, ENCODER_NO_EDGE_US);
    pass(2000);
    turn(1);
    pass(3000);
    assert_int_equal(rig.encoder.edge_age_us, 3000);
    pass(10 * TICK_US);
    assert_int_equal(rig.encoder.edge_age_us, 3000 + 10 * TICK_US);
}

static void an_edge_between_reading_the_clock_and_the_counts_has_age_zero(void **state)
{
    (void)state;
    rig.now_us += 40;
    turn(1);
    encoder_update(&rig.encoder, &rig.edges, rig.now_us - 40);
    assert_int_equal(rig.encoder.edge_age_us, 0);
    encoder_update(&rig.encoder, &rig.edges, rig.now_us + 60);
    assert_int_equal(rig.encoder.edge_age_us, 60);
}

static void an_edge_too_old_for_the_clock_never_becomes_young_again(void **state)
{
    (void)state;
    turn(1);
    for (uint64_t us = 0; us < UINT64_C(2) << 32; us += 100000000) {
        rig.now_us += 100000000;
        encoder_update(&rig.encoder, &rig.edges, rig.now_us);
        assert_true(rig.encoder.edge_age_us == ENCODER_NO_EDGE_US || us < UINT32_MAX / 2);
    }
    assert_int_equal(rig.encoder.edge_age_us, ENCODER_NO_EDGE_US);
    expect_speed(0, 0);
}

static void the_clock_may_wrap_while_the_wheel_turns(void **state)
{
    (void)state;
    rig.now_us = UINT32_MAX - 300000;
    rig.tick_us = rig.now_us + TICK_US;
    for (int i = 0; i < 60; i++) {
        turn_steadily(1, 20000);
        if (i > 0)
            expect_speed(250, 1);
    }
    assert_int_equal(rig.encoder.count, 60);
}

// --- Speed -----------------------------------------------------------------------------------------

static void a_wheel_that_never_moved_has_no_speed(void **state)
{
    (void)state;
    pass(1000000);
    expect_speed(0, 0);
}

static void one_edge_is_no_speed_yet_and_the_second_one_gives_it(void **state)
{
    (void)state;
    turn_steadily(1, 50000);
    expect_speed(0, 0);
    turn_steadily(1, 50000);
    expect_speed(100, 1);
}

static void steady_turning_is_measured_to_the_clock_whatever_the_speed(void **state)
{
    (void)state;
    const struct {
        uint32_t us_per_count;
        int mm_s;
    } cases[] = {{166668, 30}, {50000, 100}, {25000, 200}, {10000, 500}, {5000, 1000}, {2600, 1923}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        for (int direction = -1; direction <= 1; direction += 2) {
            fresh(state);
            turn_steadily(24 * direction, cases[i].us_per_count);
            expect_speed(cases[i].mm_s * direction, 2 + cases[i].mm_s * 16 / 1000);
        }
    }
}

static void uneven_phases_do_not_disturb_a_steady_speed(void **state)
{
    (void)state;
    const uint32_t phase_us[4] = {70000, 30000, 56000, 44000}; // 4 counts in 200 ms: 100 mm/s
    for (int i = 0; i < 40; i++) {
        pass(phase_us[i % 4] - TICK_US);
        if (i > 4)
            expect_speed(100, 1);
        turn(1);
        pass(TICK_US);
        if (i > 4)
            expect_speed(100, 1);
    }
}

static void without_an_edge_the_speed_falls_below_what_an_edge_would_have_shown(void **state)
{
    (void)state;
    turn_steadily(10, 20000); // 250 mm/s
    while (rig.encoder.edge_age_us < ENCODER_STILL_US) {
        int bound_q4 = 15 * 5 * 16 * 100000 / (int)rig.encoder.edge_age_us;
        assert_true(rig.encoder.speed_q4 <= bound_q4);
        assert_true(rig.encoder.speed_q4 >= (bound_q4 < 250 * 16 ? bound_q4 - 1 : 250 * 16 - 1));
        pass(TICK_US);
    }
    expect_speed(0, 0);
}

static void a_standstill_is_not_averaged_into_the_next_start(void **state)
{
    (void)state;
    turn_steadily(10, 20000);
    pass(3000000);
    turn_steadily(1, 50000);
    expect_speed(0, 0);
    turn_steadily(1, 50000);
    expect_speed(100, 1);
}

static void after_a_turn_back_only_edges_of_the_new_direction_count(void **state)
{
    (void)state;
    turn_steadily(10, 20000);
    turn_steadily(-1, 50000);
    expect_speed(0, 0);
    turn_steadily(-1, 50000);
    expect_speed(-100, 1);
}

static void a_fault_of_the_signal_does_not_distort_the_speed(void **state)
{
    (void)state;
    turn_steadily(10, 20000);
    rig.position += 2;
    pass(40000);
    pins(forward_pins[rig.position & 3]);
    turn_steadily(2, 20000);
    expect_speed(250, 1);
    turn_steadily(10, 20000);
    expect_speed(250, 1);
    assert_int_equal(rig.encoder.illegal, 1);
}

static void absurd_speed_is_cut_and_not_wrapped(void **state)
{
    for (int counts = 10; counts < 128; counts++) { // 10 to 127 m/s
        fresh(state);
        for (int i = 0; i < 10; i++) {
            pass(TICK_US - 100);
            turn(counts);
            pass(100);
            assert_int_equal(rig.encoder.speed_q4, i > 0 ? ENCODER_SPEED_MAX_Q4 : 0);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_full_cycle_is_four_counts_either_way, fresh),
        cmocka_unit_test_setup(starting_at_any_pins_makes_no_false_edge, fresh),
        cmocka_unit_test_setup(an_interrupt_without_a_change_changes_nothing, fresh),
        cmocka_unit_test_setup(both_pins_at_once_is_counted_as_a_fault_and_not_as_travel, fresh),
        cmocka_unit_test_setup(counts_go_on_past_the_eight_bits_of_the_interrupt, fresh),
        cmocka_unit_test_setup(bouncing_on_an_edge_adds_nothing, fresh),
        cmocka_unit_test_setup(the_age_runs_from_the_edge_itself_and_not_from_the_tick, fresh),
        cmocka_unit_test_setup(an_edge_between_reading_the_clock_and_the_counts_has_age_zero, fresh),
        cmocka_unit_test_setup(an_edge_too_old_for_the_clock_never_becomes_young_again, fresh),
        cmocka_unit_test_setup(the_clock_may_wrap_while_the_wheel_turns, fresh),
        cmocka_unit_test_setup(a_wheel_that_never_moved_has_no_speed, fresh),
        cmocka_unit_test_setup(one_edge_is_no_speed_yet_and_the_second_one_gives_it, fresh),
        cmocka_unit_test_setup(steady_turning_is_measured_to_the_clock_whatever_the_speed, fresh),
        cmocka_unit_test_setup(uneven_phases_do_not_disturb_a_steady_speed, fresh),
        cmocka_unit_test_setup(without_an_edge_the_speed_falls_below_what_an_edge_would_have_shown, fresh),
        cmocka_unit_test_setup(a_standstill_is_not_averaged_into_the_next_start, fresh),
        cmocka_unit_test_setup(after_a_turn_back_only_edges_of_the_new_direction_count, fresh),
        cmocka_unit_test_setup(a_fault_of_the_signal_does_not_distort_the_speed, fresh),
        cmocka_unit_test_setup(absurd_speed_is_cut_and_not_wrapped, fresh),
    };
    return cmocka_run_group_tests_name("encoder", tests, NULL, NULL);
}
