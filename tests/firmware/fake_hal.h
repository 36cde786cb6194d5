// Hardware for tests: hal.h answered from plain variables, everything put out kept for inspection.
#ifndef FAKE_HAL_H
#define FAKE_HAL_H

#include "drive.h" // DRIVE_SIDES
#include "hal.h"   // what is answered

struct hal {
    uint8_t pins[DRIVE_SIDES];
    int16_t duty[DRIVE_SIDES];
    bool coasting[DRIVE_SIDES];
    unsigned motor_calls;    // of hal_motor_set()
    unsigned interrupts_off; // depth now
    uint16_t uart_room;      // bytes that may still be put
    uint8_t uart[65536];     // bytes put
    unsigned uart_size;
    uint16_t uart_lost;
    uint16_t battery_mv;
    bool estop_pressed;
    uint8_t reset_cause;
    uint32_t boot_nonce;
    uint8_t eeprom[1024];
    unsigned eeprom_busy;   // questions to hal_eeprom_busy() until the last write is done
    unsigned eeprom_writes; // so far
    bool eeprom_stuck;      // writes change nothing
    unsigned eeprom_cut;    // the write at which power fails, counted like eeprom_writes; 0: none
    uint8_t eeprom_torn;    // what that write leaves
};

#endif
