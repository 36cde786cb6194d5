// USART 0 and its two rings.
#include "serial.h" // this file's manual

#include <avr/interrupt.h> // ISR
#include <avr/io.h>        // USART registers
#include <util/atomic.h>   // ATOMIC_BLOCK

#include "../hal.h"      // what is answered here
#include "../messages.h" // LINK_BAUD

// Powers of two, so that an index wraps by a mask. One place of each stays free to tell full from empty.
#define RX_SIZE 64u
#define TX_SIZE 128u

_Static_assert(F_CPU % (8u * LINK_BAUD) == 0, "the baud rate is exact");

static uint8_t rx_ring[RX_SIZE];
static volatile uint8_t rx_head; // next place to write; the interrupt's
static volatile uint8_t rx_tail; // next place to read; the main loop's
static volatile uint16_t rx_lost;

static uint8_t tx_ring[TX_SIZE];
static volatile uint8_t tx_head; // the main loop's
static volatile uint8_t tx_tail; // the interrupt's

ISR(USART_RX_vect)
{
    uint8_t status = UCSR0A; // goes with the byte, so it is read first
    uint8_t byte = UDR0;
    uint8_t head = rx_head;
    uint8_t next = (uint8_t)((head + 1u) & (RX_SIZE - 1u));
    bool full = next == rx_tail;
    if (!full) {
        rx_ring[head] = byte;
        rx_head = next;
    }
    if (full || (status & (1u << DOR0)))
        rx_lost++;
}

ISR(USART_UDRE_vect)
{
    uint8_t tail = tx_tail;
    UDR0 = tx_ring[tail];
    tail = (uint8_t)((tail + 1u) & (TX_SIZE - 1u));
    tx_tail = tail;
    if (tail == tx_head)
        UCSR0B &= (uint8_t)~(1u << UDRIE0);
}

void serial_init(void)
{
    UCSR0A = 1u << U2X0; // before the divider, whose meaning it changes
    UBRR0 = (uint16_t)(F_CPU / (8u * LINK_BAUD) - 1u);
    UCSR0C = 1u << UCSZ01 | 1u << UCSZ00;
    UCSR0B = 1u << RXEN0 | 1u << TXEN0 | 1u << RXCIE0;
}

bool serial_waiting(void)
{
    return rx_head != rx_tail;
}

uint8_t serial_take(void)
{
    uint8_t tail = rx_tail;
    uint8_t byte = rx_ring[tail];
    rx_tail = (uint8_t)((tail + 1u) & (RX_SIZE - 1u));
    return byte;
}

uint16_t hal_uart_room(struct hal *hal)
{
    (void)hal;
    uint8_t used = (uint8_t)(tx_head - tx_tail) & (TX_SIZE - 1u);
    return (uint16_t)(TX_SIZE - 1u - used);
}

void hal_uart_put(struct hal *hal, uint8_t byte)
{
    (void)hal;
    uint8_t head = tx_head;
    tx_ring[head] = byte;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { // the interrupt clears the same bit
        tx_head = (uint8_t)((head + 1u) & (TX_SIZE - 1u));
        UCSR0B |= 1u << UDRIE0;
    }
}

uint16_t hal_uart_lost(struct hal *hal)
{
    (void)hal;
    uint16_t lost = 0;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        lost = rx_lost;
    }
    return lost;
}
