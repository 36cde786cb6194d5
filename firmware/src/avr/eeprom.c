// The EEPROM: bytes read at once, bytes written while everything else goes on.
#include <avr/io.h>      // EEPROM registers
#include <util/atomic.h> // ATOMIC_BLOCK

#include "../hal.h" // what is answered here

bool hal_eeprom_busy(struct hal *hal)
{
    (void)hal;
    return (EECR & (1u << EEPE)) != 0;
}

// Waits in one case alone: a write that a reset has outlived, 3.4 ms at the most, when the firmware starts.
uint8_t hal_eeprom_read(struct hal *hal, uint16_t address)
{
    while (hal_eeprom_busy(hal))
        ;
    EEAR = address;
    EECR |= 1u << EERE;
    return EEDR;
}

// Erases and writes the byte, which takes the EEPROM 3.4 ms, and nobody else.
void hal_eeprom_write(struct hal *hal, uint16_t address, uint8_t byte)
{
    (void)hal;
    EEAR = address;
    EEDR = byte;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { // the second bit counts only within 4 cycles of the first
        EECR = 1u << EEMPE;
        EECR |= 1u << EEPE;
    }
}
