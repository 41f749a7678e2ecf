#define KUAFU_CHANNELS 3
#define KUAFU_FEATURES ~0u
#define KUAFU_HOST_SHADE shade_visible_full
#define KUAFU_HOST_TRANSMIT transmit_visible_full
#include "pathtrace/host_shade.inc"
