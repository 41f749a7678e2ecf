#define KUAFU_CHANNELS 1
#define KUAFU_FEATURES 0
#define KUAFU_HOST_SHADE shade_infrared
#define KUAFU_HOST_TRANSMIT transmit_infrared
#include "pathtrace/host_shade.inc"
