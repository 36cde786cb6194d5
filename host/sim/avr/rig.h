// An ATmega328P at 16 MHz on a bench: its line, wheel encoders, motor driver, battery and button, in virtual time.
//
// Time is in processor cycles since rig_new() and never goes back, whatever the processor does. Equal calls
// give equal runs, however they are cut into steps. Where simavr 1.6 differs from silicon, this corrects it:
//   interrupt entry   takes 4 cycles, not 0
//   a byte            takes 10 bit times, not 11; sent bytes arrive when their stop bit ends, not when written
//   received bytes    wait in two places and the shift register, not in 64: one more is lost and sets DOR
//   other baud rates  are noise: bytes are lost and counted
//   pulled-up inputs  keep the level that the rig drives when the firmware writes the port
//   a reset           leaves the rig's events standing
//   skipped ADIW      and SBIW with some constants are one word long, not two
//   PWM               is read from timer 1's registers, its waveform on the pins being wrong
//   RAM at power-on   is noise, not zero; it survives other resets
//   EEPROM            a byte takes 3.4 ms to write, EEPE standing; if power goes meanwhile it may be anything
// Left as it is: the transmitter takes its next byte only when the last one has left, where silicon has one place
// more, so that a saturated line carries a tenth less; the EEPROM interrupts nobody; every sleep mode is idle.
#ifndef RIG_H
#define RIG_H

#include <stddef.h> // size_t
#include <stdint.h> // integers of known width

struct rig;

struct rig_interrupt {
    uint64_t runs;
    uint64_t worst_cycles; // one run, entry and return included
    uint64_t cycles;       // all runs
};

struct rig_stats {
    struct rig_interrupt interrupts[32]; // by vector number
    uint64_t cycles;                     // since rig_clear_stats()
    uint64_t asleep_cycles;
    uint64_t byte_wait_worst_cycles; // from a received byte's last stop bit to its being read
    uint64_t masked_worst_cycles;    // interrupts off at a stretch; only while rig_watch_mask() is on
    uint32_t rx_overruns;            // received bytes lost in the processor
    uint32_t rx_wrong_baud;          // bytes lost because the firmware chose another baud rate, either way
    uint32_t resets;                 // by the watchdog
};

// Power on, EEPROM erased. `noise`: 2048 bytes, what RAM holds. NULL if the ELF cannot be read or is for another
// processor. No ELF: flash empty.
struct rig *rig_new(const char *elf, const uint8_t *noise);
void rig_free(struct rig *rig);

// Run until `cycle`. 0, or -1 if the processor has crashed (jumped nowhere, say).
int rig_run_to(struct rig *rig, uint64_t cycle);

// The line's speed from the next byte on; 250000 at first.
void rig_baud(struct rig *rig, uint32_t baud);
// Queue bytes on the line to the processor, one after another.
void rig_write(struct rig *rig, const uint8_t *bytes, size_t count);
// Take at most `size` bytes that have arrived from it; returns how many.
size_t rig_read(struct rig *rig, uint8_t *bytes, size_t size);

// Put levels, (B << 1) | A, on encoders (0 left, 1 right) at cycles that are now or to come.
void rig_encoders(struct rig *rig, size_t count, const uint8_t *sides, const uint8_t *pins,
                  const uint64_t *at_cycles);

// What the motor driver makes of the processor's pins and timer 1: -1 to 1; 0 braking or off. NAN if the timer is
// set up in a way that this does not know.
double rig_duty(const struct rig *rig, uint8_t side);
// The driver leaves this motor's ends open.
int rig_coasting(const struct rig *rig, uint8_t side);

void rig_battery_mv(struct rig *rig, uint32_t mv);
void rig_estop(struct rig *rig, int pressed);

// All 1024 bytes of the EEPROM.
void rig_eeprom_set(struct rig *rig, const uint8_t *bytes);
void rig_eeprom(struct rig *rig, uint8_t *bytes);

// One byte of data memory, registers included, as it stands: without what reading or writing it would set off.
uint8_t rig_peek(const struct rig *rig, uint16_t address);
void rig_poke(struct rig *rig, uint16_t address, uint8_t byte);

// Put a bootloader into flash and begin there at this and every later reset. It may then program the rest.
void rig_bootloader(struct rig *rig, uint32_t address, const uint8_t *bytes, size_t count);
// All 32768 bytes of flash.
void rig_flash(const struct rig *rig, uint8_t *bytes);

// Reset with these bits in MCUSR. `noise`: new contents of RAM, or NULL to leave it.
void rig_reset(struct rig *rig, uint8_t mcusr, const uint8_t *noise);
// Keep everything but interrupts from running for so long; a reset ends it.
void rig_hang(struct rig *rig, uint64_t cycles);

const struct rig_stats *rig_stats(struct rig *rig);
void rig_clear_stats(struct rig *rig);
// Look at the interrupt mask after every instruction, for masked_worst_cycles. Ten times slower.
void rig_watch_mask(struct rig *rig, int on);

// Bytes of stack ever used, counted down to where RAM first differs from the noise it came up with.
// `static_end`: the first address past the firmware's variables.
size_t rig_stack_used(const struct rig *rig, uint16_t static_end);

#endif
