#define KUAFU_CHANNELS 1
#define KUAFU_HOST_AOV aov_infrared
#include "pathtrace/host_aov.inc"
