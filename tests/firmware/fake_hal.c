// Hardware for tests: see fake_hal.h.
#include "fake_hal.h" // what this file provides

#include <stdlib.h> // abort: the firmware broke its promise to the hardware

uint8_t hal_encoder_pins(struct hal *hal, uint8_t side)
{
    return hal->pins[side];
}

uint8_t hal_interrupts_off(struct hal *hal)
{
    return (uint8_t)hal->interrupts_off++;
}

void hal_interrupts_restore(struct hal *hal, uint8_t before)
{
    if (hal->interrupts_off != before + 1u)
        abort();
    hal->interrupts_off = before;
}

void hal_motor_set(struct hal *hal, uint8_t side, int16_t duty)
{
    hal->motor_calls++;
    hal->duty[side] = duty;
    hal->coasting[side] = false;
}

void hal_motor_coast(struct hal *hal, uint8_t side)
{
    hal->motor_calls++;
    hal->duty[side] = 0;
    hal->coasting[side] = true;
}

uint16_t hal_uart_room(struct hal *hal)
{
    return hal->uart_room;
}

void hal_uart_put(struct hal *hal, uint8_t byte)
{
    if (hal->uart_room == 0 || hal->uart_size == sizeof hal->uart)
        abort();
    hal->uart_room--;
    hal->uart[hal->uart_size++] = byte;
}

uint16_t hal_uart_lost(struct hal *hal)
{
    return hal->uart_lost;
}

uint16_t hal_battery_mv(struct hal *hal)
{
    return hal->battery_mv;
}

bool hal_estop_pressed(struct hal *hal)
{
    return hal->estop_pressed;
}

bool hal_eeprom_busy(struct hal *hal)
{
    if (hal->eeprom_busy > 0)
        hal->eeprom_busy--;
    return hal->eeprom_busy > 0;
}

uint8_t hal_eeprom_read(struct hal *hal, uint16_t address)
{
    if (address >= sizeof hal->eeprom || hal->eeprom_busy > 0)
        abort();
    return hal->eeprom[address];
}

void hal_eeprom_write(struct hal *hal, uint16_t address, uint8_t byte)
{
    if (address >= sizeof hal->eeprom || hal->eeprom_busy > 0)
        abort();
    hal->eeprom_writes++;
    hal->eeprom_busy = 3;
    if (hal->eeprom_writes == hal->eeprom_cut)
        hal->eeprom[address] = hal->eeprom_torn;
    else if (!hal->eeprom_stuck)
        hal->eeprom[address] = byte;
}

uint8_t hal_reset_cause(struct hal *hal)
{
    return hal->reset_cause;
}

uint32_t hal_boot_nonce(struct hal *hal)
{
    return hal->boot_nonce;
}
