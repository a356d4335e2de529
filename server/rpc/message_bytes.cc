#include "server/rpc/message_bytes.h"

#include "grpcpp/support/slice.h"

namespace deform::server {

bool ParseMessage(const grpc::ByteBuffer& bytes,
                  google::protobuf::MessageLite& message) {
  grpc::Slice slice;
  return bytes.DumpToSingleSlice(&slice).ok() &&
         message.ParseFromArray(slice.begin(), static_cast<int>(slice.size()));
}

grpc::ByteBuffer SerializeMessage(
    const google::protobuf::MessageLite& message) {
  const grpc::Slice slice(message.SerializeAsString());
  return grpc::ByteBuffer(&slice, 1);
}

}  // namespace deform::server
