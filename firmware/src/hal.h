// What hardware must answer for the firmware to run on it; everything above is plain C.
//
// Two implementations: the ATmega328P's registers, and the simulated board. `hal` is theirs to define; the
// firmware only hands it through. Time is not here: whoever calls robot_tick() and robot_receive_byte() says
// what time it is. The implementation must, besides answering these,
//   - keep the motors off from reset until the first hal_motor_set(),
//   - call robot_encoder_edge() whenever an encoder pin may have changed,
//   - call robot_receive_byte() for every byte received, a bounded number of them between two ticks,
//   - call robot_tick() every ROBOT_TICK_US.
#ifndef HAL_H
#define HAL_H

#include <stdbool.h> // bool
#include <stdint.h>  // integers of known width

struct hal;

// Levels of one wheel's encoder pins now, (B << 1) | A; forward is A leading B. side: DRIVE_LEFT or _RIGHT.
uint8_t hal_encoder_pins(struct hal *hal, uint8_t side);

// Keep interrupts out while several bytes are copied. Both calls are compiler barriers; they nest.
uint8_t hal_interrupts_off(struct hal *hal);
void hal_interrupts_restore(struct hal *hal, uint8_t before);

// Voltage of one motor as a signed fraction of the battery's, 32767 = 1; 0 brakes by shorting the motor.
void hal_motor_set(struct hal *hal, uint8_t side, int16_t duty);

// Let go of one motor: open, so that its wheel rolls freely, until the next hal_motor_set().
void hal_motor_coast(struct hal *hal, uint8_t side);

// The transmit buffer: bytes it can take, and one byte into it. Nobody puts a byte without room for it.
uint16_t hal_uart_room(struct hal *hal);
void hal_uart_put(struct hal *hal, uint8_t byte);

// Received bytes lost so far before the firmware saw them; wraps.
uint16_t hal_uart_lost(struct hal *hal);

uint16_t hal_battery_mv(struct hal *hal); // 0: cannot be measured
bool hal_estop_pressed(struct hal *hal);

// The EEPROM, 1024 bytes, erased to 0xFF. A write takes milliseconds, during which it is busy; nobody waits:
// a write or read is asked for only when it is not busy, save that a read at start may have to wait for a
// write begun before the reset.
bool hal_eeprom_busy(struct hal *hal);
uint8_t hal_eeprom_read(struct hal *hal, uint16_t address);
void hal_eeprom_write(struct hal *hal, uint16_t address, uint8_t byte);

uint8_t hal_reset_cause(struct hal *hal); // enum reset_cause of messages.h
uint32_t hal_boot_nonce(struct hal *hal); // another number after every start, constant until the next

#endif
