// What may differ between two robots: the parameters of messages.h, kept in EEPROM.
//
// Two slots hold a whole set each; a save goes to the one that does not hold the newest set, so the newest
// stays until the next is complete. A slot:
//
//    0   u32   PARAMS_VERSION: which list of parameters this is
//    4   u32   generation, one more than that of the set before; wraps
//    8   i32   the values, in the order of enum param
//    ..  u32   CRC-32C of all that
//    ..  u8    PARAMS_MARK: the slot is whole
//
// A save removes the mark first and sets it last, after reading back all the rest. Power may fail at any byte
// of it, and leave anything in that byte: the next start finds the old set or the new one. A start takes the
// newest slot that is marked, has the right version and checksum, and holds nothing out of range; without
// one, defaults. Another list of parameters means defaults too: values are never taken for what they are not.
//
// Nothing here ever waits for the EEPROM, which takes 3.4 ms a byte: params_tick() writes at most one. Bytes
// that are right already are not written again.
#ifndef PARAMS_H
#define PARAMS_H

#include <stdbool.h> // bool
#include <stdint.h>  // integers of known width

#include "hal.h"      // the EEPROM
#include "messages.h" // enum param, their defaults and ranges

#define PARAMS_WORDS (PARAM_COUNT + 3u)         // of four bytes each: version, generation, values, checksum
#define PARAMS_SLOT_BYTES (4u * PARAMS_WORDS + 1u) // and the mark
#define PARAMS_MARK 0xA5u

// Apart from address 0, where a processor writes that has lost its wits with its supply.
#define PARAMS_FIRST_SLOT 16u
#define PARAMS_SECOND_SLOT 528u

enum params_saving { PARAMS_IDLE, PARAMS_SAVING, PARAMS_SAVED, PARAMS_NOT_STORED };

struct params {
    int32_t values[PARAM_COUNT];

    struct hal *hal;
    uint32_t generation; // of the newest set stored; 0 before the first
    uint32_t checksum;   // of the set being saved
    uint16_t newest;     // address of its slot, 0 when there is none
    uint8_t step;        // of the save: 0 none, 1 remove the mark, then the bytes, then the mark
};

// Values from EEPROM, or defaults.
void params_init(struct params *params, struct hal *hal);

// As it is now. `param` is one of enum param.
static inline int32_t params_get(const struct params *params, uint8_t param)
{
    return params->values[param];
}

// Set a value until the next start; false, and no change, when there is no such parameter or the value is out
// of its range. Not while saving.
bool params_set(struct params *params, uint8_t param, int32_t value);

// Begin to write all values; params_tick() does it. Not while saving.
void params_save(struct params *params);

// Every tick. PARAMS_SAVED and PARAMS_NOT_STORED are told once; after the latter the set before is still
// there.
uint8_t params_tick(struct params *params);

#endif
