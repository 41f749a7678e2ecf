#define KUAFU_CHANNELS 3
#define KUAFU_FEATURES 0
#define KUAFU_HOST_SHADE shade_visible
#define KUAFU_HOST_TRANSMIT transmit_visible
#include "pathtrace/host_shade.inc"
