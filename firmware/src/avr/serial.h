// The serial line: received and transmitted bytes wait in two rings, moved by interrupts.
//
// hal_uart_room(), hal_uart_put() and hal_uart_lost() are here too.
#ifndef AVR_SERIAL_H
#define AVR_SERIAL_H

#include <stdbool.h> // bool
#include <stdint.h>  // integers of known width

// LINK_BAUD, 8 bits, no parity, one stop bit; both rings empty.
void serial_init(void);

// A received byte waits.
bool serial_waiting(void);

// The oldest byte received; only while serial_waiting().
uint8_t serial_take(void);

#endif
