// Large arrays in one file, read without a copy.
//
//   body      arrays, each at a multiple of 64 bytes, zeros between
//   table     sealed (bytes.h): address, size of the body, name, offset and
//             size of each array, checksum of each MiB of the body
//   trailer   sealed: size of the table, version, "deform\r\n"
//
// The body comes first, so that arrays lie in whole pages; every byte is
// covered by a checksum. `address` says whose content this is: a file under
// another's name is found out, too.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "server/stores/file_system.h"
#include "server/stores/records.h"

namespace deform::server {

// Writes a new file and syncs it; not yet its name.
absl::Status WriteArrayFile(FileSystem& files, const std::string& path,
                            absl::string_view address,
                            const StoredArrays& arrays);

// Reads the file once to verify it, then maps it. By reading, since a sector
// that cannot be read is an error of read(), but ends a process that meets it
// in a mapping.
//
// DataLoss FILE_DAMAGED says what is wrong; FailedPrecondition FORMAT_TOO_NEW
// if a newer version wrote it; what FileError() makes of the system's.
absl::StatusOr<StoredArrays> ReadArrayFile(FileSystem& files,
                                           const std::string& path,
                                           absl::string_view address);

}  // namespace deform::server
