#define PINSING_ISA baseline
#define PINSING_ISA_NAME "baseline"
#define PINSING_KERNEL kernel_baseline
#include "kernel.inc"
