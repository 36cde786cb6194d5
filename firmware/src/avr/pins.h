// Which pin of an Arduino Uno or Nano is which; docs/hardware.md draws the wires.
//
// Encoder pins share port C with nothing that is written while running, so that one read of PINC sees both
// wheels at one moment.
#ifndef AVR_PINS_H
#define AVR_PINS_H

#include <avr/io.h> // register bits

#define PIN_BIT(bit) ((uint8_t)(1u << (bit)))

// Port B
#define PIN_LEFT_IN2 PIN_BIT(PB0)  // D8, driver AIN2
#define PIN_LEFT_PWM PIN_BIT(PB1)  // D9, OC1A, driver PWMA
#define PIN_RIGHT_PWM PIN_BIT(PB2) // D10, OC1B, driver PWMB
#define PIN_LED PIN_BIT(PB5)       // D13, the board's own

// Port C
#define PIN_LEFT_SHIFT 0  // A0, A1: left encoder A and B
#define PIN_RIGHT_SHIFT 2 // A2, A3: right encoder A and B
#define PIN_LEFT_ENCODER ((uint8_t)(3u << PIN_LEFT_SHIFT))
#define PIN_RIGHT_ENCODER ((uint8_t)(3u << PIN_RIGHT_SHIFT))
#define PIN_BATTERY_ADC 4 // A4

// Port D
#define PIN_ESTOP PIN_BIT(PD2)     // D2, button to ground, open means stop
#define PIN_RIGHT_IN1 PIN_BIT(PD4) // D4, driver BIN1
#define PIN_RIGHT_IN2 PIN_BIT(PD5) // D5, driver BIN2
#define PIN_STANDBY PIN_BIT(PD6)   // D6, driver STBY, low turns both motors off
#define PIN_LEFT_IN1 PIN_BIT(PD7)  // D7, driver AIN1

#endif
