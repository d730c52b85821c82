/* wait_stm32_v1.c -- sleeps until the USART of STM32 F1, F2 and F4 has a byte (RM0041 chapter 23; RM0090 chapter 30)
 *
 * The interrupt is raised as long as the byte is there. It is cleared before the last look, so that a byte that comes
 * after the look ends the sleep.
 */
#include "board.h"
#include "board_config.h"

#define USART_SR (*(volatile uint32_t *)(BOARD_UART_BASE + 0x00U))
#define USART_CR1 (*(volatile uint32_t *)(BOARD_UART_BASE + 0x0CU))

#define SR_RXNE (1U << 5)
#define CR1_RXNEIE (1U << 5)

void uart_wait(void) {
    USART_CR1 |= CR1_RXNEIE;
    interrupt_clear(BOARD_UART_INTERRUPT);
    if ((USART_SR & SR_RXNE) == 0U) {
        interrupt_wait(BOARD_UART_INTERRUPT);
    }
}
