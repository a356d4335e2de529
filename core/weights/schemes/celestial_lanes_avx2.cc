#define DEFORM_LANES Avx2Lanes
#define DEFORM_LANE_BYTES 32
#include "core/weights/schemes/celestial_lanes.inc"
