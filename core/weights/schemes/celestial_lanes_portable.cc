#define DEFORM_LANES PortableLanes
#define DEFORM_LANE_BYTES 16
#include "core/weights/schemes/celestial_lanes.inc"
