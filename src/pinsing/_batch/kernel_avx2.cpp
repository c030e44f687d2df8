#define PINSING_ISA avx2
#define PINSING_ISA_NAME "avx2"
#define PINSING_KERNEL kernel_avx2
#include "kernel.inc"
