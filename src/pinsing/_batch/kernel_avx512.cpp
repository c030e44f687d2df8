#define PINSING_ISA avx512
#define PINSING_ISA_NAME "avx512"
#define PINSING_KERNEL kernel_avx512
#include "kernel.inc"
