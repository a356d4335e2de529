// The gradients of Green coordinates with respect to the point.
#pragma once

#include "core/weights/cage_faces.h"
#include "core/weights/scheme.h"

namespace deform {

// Sets the gradients of the integrals of [L08] Eq. 12 at `eta`, which does not
// lie on the cage: `phi` is V x 3 (no unit over length), `psi` F x 3 (no unit).
// Thread-safe. O(V + F).
void GreenGradients(const CageFaces& faces, const Vec3& eta,
                    Eigen::Ref<Positions> phi, Eigen::Ref<Positions> psi);

}  // namespace deform
