// Specification of params.c: defaults, ranges, what is kept, and what a power cut at any byte leaves.
#include <setjmp.h> // cmocka
#include <stdarg.h> // cmocka
#include <stddef.h> // cmocka
#include <stdint.h> // cmocka

#include <cmocka.h> // the test framework
#include <string.h> // memset, memcmp

#include "fake_hal.h" // hardware of variables
#include "link.h"     // link_crc32c
#include "params.h"   // what is specified here

#define MARK_AT (4u * PARAMS_WORDS)
#define SECOND_PARAM_AT 12u // in a slot

static const uint16_t slots[2] = {PARAMS_FIRST_SLOT, PARAMS_SECOND_SLOT};

static struct {
    struct hal hal;
    struct params params;
} rig;

static bool is_saving(void)
{
    return rig.params.step != 0;
}

static int erased(void **state)
{
    (void)state;
    memset(&rig, 0, sizeof rig);
    memset(rig.hal.eeprom, 0xFF, sizeof rig.hal.eeprom);
    params_init(&rig.params, &rig.hal);
    return 0;
}

static void restart(void)
{
    rig.hal.eeprom_busy = 0;
    params_init(&rig.params, &rig.hal);
}

// Ticks until the save is over; what the last of them says. At most one byte is written in each.
static uint8_t finish(void)
{
    for (int tick = 0; tick < 1000; tick++) {
        unsigned before = rig.hal.eeprom_writes;
        uint8_t saving = params_tick(&rig.params);
        assert_true(rig.hal.eeprom_writes - before <= 1);
        assert_int_equal(is_saving(), saving == PARAMS_SAVING);
        if (saving != PARAMS_SAVING)
            return saving;
    }
    fail_msg("a save has no end");
    return PARAMS_IDLE;
}

static uint8_t save(void)
{
    params_save(&rig.params);
    return finish();
}

// A value for every parameter, in its range, that depends on `which`.
static int32_t value_of(uint8_t param, unsigned which)
{
    static const int32_t lowest[] = {
#define LOWEST(name, initial, lowest, highest) lowest,
        PARAM_LIST(LOWEST)};
    return lowest[param] + (int32_t)(7 * which + param);
}

static void set_all(unsigned which)
{
    for (uint8_t param = 0; param < PARAM_COUNT; param++)
        assert_true(params_set(&rig.params, param, value_of(param, which)));
}

static bool are(unsigned which)
{
    for (uint8_t param = 0; param < PARAM_COUNT; param++) {
        if (params_get(&rig.params, param) != value_of(param, which))
            return false;
    }
    return true;
}

static void expect_defaults(void)
{
    static const int32_t initials[] = {
#define INITIAL(name, initial, lowest, highest) initial,
        PARAM_LIST(INITIAL)};
    for (uint8_t param = 0; param < PARAM_COUNT; param++)
        assert_int_equal(params_get(&rig.params, param), initials[param]);
}

// --- Values ----------------------------------------------------------------------------------------

static void an_erased_eeprom_means_defaults(void **state)
{
    (void)state;
    expect_defaults();
    assert_int_equal(rig.hal.eeprom_writes, 0);
}

static void a_value_is_taken_in_its_range_and_nowhere_else(void **state)
{
    (void)state;
    static const struct {
        uint8_t param;
        int32_t lowest, highest;
    } ranges[] = {
#define RANGE(name, initial, lowest, highest) {PARAM_##name, lowest, highest},
        PARAM_LIST(RANGE)};
    for (size_t i = 0; i < PARAM_COUNT; i++) {
        uint8_t param = ranges[i].param;
        assert_true(params_set(&rig.params, param, ranges[i].highest));
        assert_false(params_set(&rig.params, param, ranges[i].highest + 1));
        assert_false(params_set(&rig.params, param, INT32_MAX));
        assert_int_equal(params_get(&rig.params, param), ranges[i].highest);
        assert_true(params_set(&rig.params, param, ranges[i].lowest));
        assert_false(params_set(&rig.params, param, ranges[i].lowest - 1));
        assert_false(params_set(&rig.params, param, INT32_MIN));
        assert_int_equal(params_get(&rig.params, param), ranges[i].lowest);
    }
}

static void there_is_no_parameter_beyond_the_last(void **state)
{
    (void)state;
    assert_false(params_set(&rig.params, PARAM_COUNT, 5000));
    assert_false(params_set(&rig.params, 255, 5000));
    expect_defaults();
}

// --- Saving ----------------------------------------------------------------------------------------

static void a_value_that_was_not_saved_is_gone_after_a_restart(void **state)
{
    (void)state;
    set_all(1);
    restart();
    expect_defaults();
}

static void what_was_saved_last_is_there_after_a_restart(void **state)
{
    (void)state;
    for (unsigned which = 1; which <= 5; which++) {
        set_all(which);
        assert_int_equal(save(), PARAMS_SAVED);
        set_all(99);
        restart();
        assert_true(are(which));
    }
}

static void nothing_happens_unasked(void **state)
{
    (void)state;
    for (int tick = 0; tick < 100; tick++)
        assert_int_equal(params_tick(&rig.params), PARAMS_IDLE);
    assert_int_equal(rig.hal.eeprom_writes, 0);
}

static void a_slot_is_what_params_h_says(void **state)
{
    (void)state;
    set_all(3);
    save();
    const uint8_t *slot = rig.hal.eeprom + PARAMS_FIRST_SLOT;
    assert_int_equal(msg_get_u32(slot), PARAMS_VERSION);
    assert_int_equal(msg_get_u32(slot + 4), 1);
    for (uint8_t param = 0; param < PARAM_COUNT; param++)
        assert_int_equal(msg_get_u32(slot + 8 + 4 * param), value_of(param, 3));
    assert_int_equal(msg_get_u32(slot + MARK_AT - 4), link_crc32c(slot, MARK_AT - 4));
    assert_int_equal(slot[MARK_AT], PARAMS_MARK);
}

static void nothing_is_written_outside_the_slots(void **state)
{
    (void)state;
    memset(rig.hal.eeprom, 0x5A, sizeof rig.hal.eeprom);
    for (unsigned which = 1; which <= 4; which++) {
        set_all(which);
        save();
    }
    for (unsigned at = 0; at < sizeof rig.hal.eeprom; at++) {
        bool in_slot = at - slots[0] < PARAMS_SLOT_BYTES || at - slots[1] < PARAMS_SLOT_BYTES;
        assert_true(in_slot || rig.hal.eeprom[at] == 0x5A);
    }
}

static void bytes_that_are_right_already_are_not_written_again(void **state)
{
    (void)state;
    for (int i = 0; i < 2; i++) // both slots hold the same values
        save();
    rig.hal.eeprom_writes = 0;
    params_set(&rig.params, PARAM_BATTERY_MIN_MV, params_get(&rig.params, PARAM_BATTERY_MIN_MV) + 1);
    assert_int_equal(save(), PARAMS_SAVED);
    // mark off, one byte of the generation, one of the value, four of the checksum at the most, mark on
    assert_in_range(rig.hal.eeprom_writes, 5, 8);
}

static void the_slots_take_turns(void **state)
{
    (void)state;
    for (unsigned which = 1; which <= 4; which++) {
        uint8_t before[2] = {rig.hal.eeprom[slots[0] + 4], rig.hal.eeprom[slots[1] + 4]};
        set_all(which);
        save();
        unsigned written = (which + 1) % 2;
        assert_int_equal(rig.hal.eeprom[slots[written] + 4], which);
        assert_int_equal(rig.hal.eeprom[slots[!written] + 4], before[!written]);
    }
}

static void generations_wrap(void **state)
{
    (void)state;
    set_all(1);
    rig.params.generation = UINT32_MAX - 2;
    for (unsigned which = 1; which <= 6; which++) {
        set_all(which);
        assert_int_equal(save(), PARAMS_SAVED);
        restart();
        assert_true(are(which));
    }
    assert_true(rig.params.generation < 10);
}

static void an_eeprom_that_keeps_something_else_is_noticed_and_the_old_set_stays(void **state)
{
    (void)state;
    set_all(1);
    save();
    set_all(2);
    rig.hal.eeprom_stuck = true;
    assert_int_equal(save(), PARAMS_NOT_STORED);
    assert_int_equal(params_tick(&rig.params), PARAMS_IDLE); // told once
    assert_true(are(2));
    restart();
    assert_true(are(1));
    rig.hal.eeprom_stuck = false;
    set_all(2);
    assert_int_equal(save(), PARAMS_SAVED);
}

static void a_mark_that_does_not_hold_is_noticed(void **state)
{
    (void)state;
    set_all(1);
    params_save(&rig.params);
    rig.hal.eeprom_cut = 0;
    unsigned writes = 0;
    while (is_saving()) { // find out how many writes there are: the mark is the last
        writes = rig.hal.eeprom_writes;
        params_tick(&rig.params);
    }
    erased(state);
    rig.hal.eeprom_cut = writes;
    rig.hal.eeprom_torn = 0xA4;
    set_all(1);
    assert_int_equal(save(), PARAMS_NOT_STORED);
    restart();
    expect_defaults();
}

// --- Loading ---------------------------------------------------------------------------------------

static void refresh_checksum(uint16_t slot)
{
    uint8_t *bytes = rig.hal.eeprom + slot;
    msg_put_u32(bytes + MARK_AT - 4, link_crc32c(bytes, MARK_AT - 4));
}

static void any_single_wrong_bit_in_the_newest_slot_brings_back_the_set_before(void **state)
{
    (void)state;
    set_all(1);
    save();
    set_all(2);
    save();
    for (unsigned bit = 0; bit < 8 * PARAMS_SLOT_BYTES; bit++) {
        uint8_t *byte = rig.hal.eeprom + slots[1] + bit / 8;
        *byte ^= (uint8_t)(1u << bit % 8);
        restart();
        assert_true(are(1));
        *byte ^= (uint8_t)(1u << bit % 8);
    }
    restart();
    assert_true(are(2));
}

static void a_set_of_another_list_of_parameters_is_not_taken(void **state)
{
    (void)state;
    set_all(1);
    save();
    msg_put_u32(rig.hal.eeprom + slots[0], PARAMS_VERSION + 1);
    refresh_checksum(slots[0]);
    restart();
    expect_defaults();
}

static void a_set_with_one_value_out_of_range_is_not_taken(void **state)
{
    (void)state;
    set_all(1);
    save();
    const int32_t wrong[] = {99, 40001, -5000, INT32_MIN, INT32_MAX};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        msg_put_u32(rig.hal.eeprom + slots[0] + SECOND_PARAM_AT, (uint32_t)wrong[i]);
        refresh_checksum(slots[0]);
        restart();
        expect_defaults();
    }
    msg_put_u32(rig.hal.eeprom + slots[0] + SECOND_PARAM_AT, 40000);
    refresh_checksum(slots[0]);
    restart();
    assert_int_equal(params_get(&rig.params, PARAM_UM_PER_COUNT_RIGHT), 40000);
}

static void chance_is_never_a_set(void **state)
{
    (void)state;
    uint32_t chance = 12345;
    for (int i = 0; i < 2000; i++) {
        for (size_t at = 0; at < sizeof rig.hal.eeprom; at++) {
            chance = chance * 1664525u + 1013904223u;
            rig.hal.eeprom[at] = (uint8_t)(chance >> 24);
        }
        for (int slot = 0; slot < 2; slot++)
            rig.hal.eeprom[slots[slot] + MARK_AT] = PARAMS_MARK;
        restart();
        expect_defaults();
    }
}

// --- Power cuts ------------------------------------------------------------------------------------

// Save set after set, cut the power at every write of the save in question, and let the byte then written be
// anything. After the restart there is the old set, whole, or the new one; and saving goes on as ever.
static void cut_everywhere(unsigned saved_before)
{
    unsigned cuts = 0;
    for (unsigned cut = 1;; cut++) {
        for (unsigned torn = 0; torn < 256; torn++) {
            erased(NULL);
            for (unsigned which = 1; which <= saved_before; which++) {
                set_all(which);
                save();
            }
            rig.hal.eeprom_writes = 0;
            rig.hal.eeprom_cut = cut;
            rig.hal.eeprom_torn = (uint8_t)torn;
            set_all(saved_before + 1);
            params_save(&rig.params);
            while (is_saving() && rig.hal.eeprom_writes < cut)
                params_tick(&rig.params);
            if (rig.hal.eeprom_writes < cut) { // the save is over: there was nothing left to cut
                assert_true(cuts > 50);
                return;
            }
            cuts++;
            restart();
            if (saved_before == 0 && !are(1))
                expect_defaults();
            else
                assert_true(are(saved_before + 1) || are(saved_before));
            set_all(saved_before + 2);
            assert_int_equal(save(), PARAMS_SAVED);
            restart();
            assert_true(are(saved_before + 2));
        }
    }
}

static void a_power_cut_at_any_byte_of_the_first_save_leaves_defaults_or_the_set(void **state)
{
    (void)state;
    cut_everywhere(0);
}

static void a_power_cut_at_any_byte_leaves_the_old_set_or_the_new_one(void **state)
{
    (void)state;
    cut_everywhere(1);
    cut_everywhere(2);
    cut_everywhere(3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(an_erased_eeprom_means_defaults, erased),
        cmocka_unit_test_setup(a_value_is_taken_in_its_range_and_nowhere_else, erased),
        cmocka_unit_test_setup(there_is_no_parameter_beyond_the_last, erased),
        cmocka_unit_test_setup(a_value_that_was_not_saved_is_gone_after_a_restart, erased),
        cmocka_unit_test_setup(what_was_saved_last_is_there_after_a_restart, erased),
        cmocka_unit_test_setup(nothing_happens_unasked, erased),
        cmocka_unit_test_setup(a_slot_is_what_params_h_says, erased),
        cmocka_unit_test_setup(nothing_is_written_outside_the_slots, erased),
        cmocka_unit_test_setup(bytes_that_are_right_already_are_not_written_again, erased),
        cmocka_unit_test_setup(the_slots_take_turns, erased),
        cmocka_unit_test_setup(generations_wrap, erased),
        cmocka_unit_test_setup(an_eeprom_that_keeps_something_else_is_noticed_and_the_old_set_stays, erased),
        cmocka_unit_test_setup(a_mark_that_does_not_hold_is_noticed, erased),
        cmocka_unit_test_setup(any_single_wrong_bit_in_the_newest_slot_brings_back_the_set_before, erased),
        cmocka_unit_test_setup(a_set_of_another_list_of_parameters_is_not_taken, erased),
        cmocka_unit_test_setup(a_set_with_one_value_out_of_range_is_not_taken, erased),
        cmocka_unit_test_setup(chance_is_never_a_set, erased),
        cmocka_unit_test_setup(a_power_cut_at_any_byte_of_the_first_save_leaves_defaults_or_the_set, erased),
        cmocka_unit_test_setup(a_power_cut_at_any_byte_leaves_the_old_set_or_the_new_one, erased),
    };
    return cmocka_run_group_tests_name("params", tests, NULL, NULL);
}
