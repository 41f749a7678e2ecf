#define KUAFU_CHANNELS 1
#define KUAFU_FEATURES ~0u
#define KUAFU_HOST_SHADE shade_infrared_full
#define KUAFU_HOST_TRANSMIT transmit_infrared_full
#include "pathtrace/host_shade.inc"
