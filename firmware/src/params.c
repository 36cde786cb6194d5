// Parameters in two slots of the EEPROM: loading, checking, and saving one byte at a time. See params.h.
#include "params.h" // this file's manual

#include "flash.h" // IN_FLASH
#include "link.h"  // link_crc32c

#define CHECKED_BYTES (4u * (PARAMS_WORDS - 1u)) // all before the checksum
#define SET_BYTES (4u * PARAMS_WORDS)
#define NO_MARK 0xFFu // as erased

// Steps of a save
#define STEP_UNMARK 1u
#define STEP_FIRST_BYTE 2u
#define STEP_MARK (uint8_t)(STEP_FIRST_BYTE + SET_BYTES)
#define STEP_CHECK_MARK (uint8_t)(STEP_MARK + 1u)

_Static_assert(SET_BYTES <= 250, "a step is one byte");
_Static_assert(PARAMS_FIRST_SLOT + PARAMS_SLOT_BYTES <= PARAMS_SECOND_SLOT, "the slots lie apart");
_Static_assert(PARAMS_SECOND_SLOT + PARAMS_SLOT_BYTES <= 1024, "an ATmega328P's EEPROM");

struct range {
    int32_t initial, lowest, highest;
};

#define RANGE(name, initial, lowest, highest) {initial, lowest, highest},
static const IN_FLASH struct range ranges[PARAM_COUNT] = {PARAM_LIST(RANGE)};

static bool in_range(uint8_t param, int32_t value)
{
    return value >= ranges[param].lowest && value <= ranges[param].highest;
}

// --- Loading ---------------------------------------------------------------------------------------

// The values of a slot in bytes, or false when they cannot be trusted.
static bool read_slot(struct hal *hal, uint16_t slot, uint8_t bytes[SET_BYTES])
{
    for (uint8_t i = 0; i < SET_BYTES; i++)
        bytes[i] = hal_eeprom_read(hal, (uint16_t)(slot + i));
    if (hal_eeprom_read(hal, (uint16_t)(slot + SET_BYTES)) != PARAMS_MARK)
        return false;
    if (msg_get_u32(bytes) != PARAMS_VERSION)
        return false;
    if (msg_get_u32(bytes + CHECKED_BYTES) != link_crc32c(bytes, CHECKED_BYTES))
        return false;
    for (uint8_t param = 0; param < PARAM_COUNT; param++) {
        if (!in_range(param, (int32_t)msg_get_u32(bytes + 8 + 4 * param)))
            return false;
    }
    return true;
}

static void load_slot(struct params *params, uint16_t slot)
{
    uint8_t bytes[SET_BYTES];
    if (!read_slot(params->hal, slot, bytes))
        return;
    uint32_t generation = msg_get_u32(bytes + 4);
    if (params->newest != 0 && (int32_t)(generation - params->generation) < 0)
        return;
    params->newest = slot;
    params->generation = generation;
    for (uint8_t param = 0; param < PARAM_COUNT; param++)
        params->values[param] = (int32_t)msg_get_u32(bytes + 8 + 4 * param);
}

void params_init(struct params *params, struct hal *hal)
{
    *params = (struct params){.hal = hal};
    for (uint8_t param = 0; param < PARAM_COUNT; param++)
        params->values[param] = ranges[param].initial;
    load_slot(params, PARAMS_FIRST_SLOT);
    load_slot(params, PARAMS_SECOND_SLOT);
}

bool params_set(struct params *params, uint8_t param, int32_t value)
{
    if (param >= PARAM_COUNT || !in_range(param, value))
        return false;
    params->values[param] = value;
    return true;
}

// --- Saving ----------------------------------------------------------------------------------------

static uint16_t slot_to_write(const struct params *params)
{
    return params->newest == PARAMS_FIRST_SLOT ? PARAMS_SECOND_SLOT : PARAMS_FIRST_SLOT;
}

// Byte `at` of the set being saved.
static uint8_t byte_to_write(const struct params *params, uint8_t at)
{
    uint8_t word = at / 4;
    uint32_t value = params->checksum;
    if (word == 0)
        value = PARAMS_VERSION;
    else if (word == 1)
        value = params->generation + 1;
    else if (word < PARAMS_WORDS - 1)
        value = (uint32_t)params->values[word - 2];
    return (uint8_t)(value >> (8 * (at % 4)));
}

void params_save(struct params *params)
{
    uint8_t bytes[CHECKED_BYTES];
    for (uint8_t at = 0; at < CHECKED_BYTES; at++)
        bytes[at] = byte_to_write(params, at);
    params->checksum = link_crc32c(bytes, CHECKED_BYTES);
    params->step = STEP_UNMARK;
}

static void write_if_other(struct hal *hal, uint16_t address, uint8_t byte)
{
    if (hal_eeprom_read(hal, address) != byte)
        hal_eeprom_write(hal, address, byte);
}

static bool all_written(const struct params *params, uint16_t slot)
{
    for (uint8_t at = 0; at < SET_BYTES; at++) {
        if (hal_eeprom_read(params->hal, (uint16_t)(slot + at)) != byte_to_write(params, at))
            return false;
    }
    return true;
}

uint8_t params_tick(struct params *params)
{
    if (params->step == 0)
        return PARAMS_IDLE;
    if (hal_eeprom_busy(params->hal))
        return PARAMS_SAVING;

    uint16_t slot = slot_to_write(params);
    uint16_t mark = (uint16_t)(slot + SET_BYTES);
    uint8_t step = params->step++;
    if (step == STEP_UNMARK) {
        write_if_other(params->hal, mark, NO_MARK);
    } else if (step < STEP_MARK) {
        uint8_t at = (uint8_t)(step - STEP_FIRST_BYTE);
        write_if_other(params->hal, (uint16_t)(slot + at), byte_to_write(params, at));
    } else if (step == STEP_MARK && all_written(params, slot)) {
        hal_eeprom_write(params->hal, mark, PARAMS_MARK);
    } else {
        params->step = 0;
        if (step != STEP_CHECK_MARK || hal_eeprom_read(params->hal, mark) != PARAMS_MARK)
            return PARAMS_NOT_STORED;
        params->newest = slot;
        params->generation++;
        return PARAMS_SAVED;
    }
    return PARAMS_SAVING;
}
