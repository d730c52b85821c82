/* uart_stm32_v1.c -- the USART of STM32 F1, F2 and F4
 *
 * RM0041 chapter 23; RM0368 chapter 19; RM0383 chapter 19; RM0090 chapter 30. Clock gates and pins are the target's
 * setup.
 */
#include "board.h"
#include "board_config.h"

#define USART_SR (*(volatile uint32_t *)(BOARD_UART_BASE + 0x00U))
#define USART_DR (*(volatile uint32_t *)(BOARD_UART_BASE + 0x04U))
#define USART_BRR (*(volatile uint32_t *)(BOARD_UART_BASE + 0x08U))
#define USART_CR1 (*(volatile uint32_t *)(BOARD_UART_BASE + 0x0CU))

#define SR_RXNE (1U << 5)
#define SR_TXE (1U << 7)
#define CR1_UE_TE_RE ((1U << 13) | (1U << 3) | (1U << 2))

void uart_start(void) {
    USART_CR1 = 0U;
    USART_BRR = (BOARD_UART_CLOCK_HZ + BOARD_UART_BAUD / 2U) / BOARD_UART_BAUD; /* oversampling by 16 */
    USART_CR1 = CR1_UE_TE_RE;
}

void uart_put(uint8_t byte) {
    while (!uart_ready()) {
    }
    USART_DR = byte;
}

bool uart_ready(void) {
    return (USART_SR & SR_TXE) != 0U;
}

int32_t uart_get(void) {
    if ((USART_SR & SR_RXNE) == 0U) {
        return -1;
    }
    return (int32_t)(USART_DR & 0xFFU); /* after SR, this also clears an overrun */
}
