// A call of bytes, for what no proper client would send.
#pragma once

#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "client/cpp/status.h"

namespace deform {

inline std::shared_ptr<grpc::Channel> PlainChannel(const std::string& address) {
  return grpc::CreateChannel(address, grpc::InsecureChannelCredentials());
}

struct RawAnswer {
  std::string first;    // First message, if any.
  absl::Status status;  // How the call ended.
};

// Sends one message, half-closes, and reads to the end.
inline RawAnswer RawCall(const std::string& address, const std::string& method,
                         const std::string& request) {
  grpc::GenericStub stub(PlainChannel(address));
  grpc::ClientContext context;
  grpc::CompletionQueue queue;
  const auto next = [&queue] {
    void* tag = nullptr;
    bool ok = false;
    return queue.Next(&tag, &ok) && ok;
  };
  const auto call = stub.PrepareCall(&context, method, &queue);
  call->StartCall(nullptr);
  next();
  const grpc::Slice slice(request);
  call->Write(grpc::ByteBuffer(&slice, 1), grpc::WriteOptions(), nullptr);
  next();
  call->WritesDone(nullptr);
  next();
  RawAnswer answer;
  for (bool first = true;; first = false) {
    grpc::ByteBuffer bytes;
    call->Read(&bytes, nullptr);
    if (!next()) break;
    std::vector<grpc::Slice> slices;
    if (first && bytes.Dump(&slices).ok()) {
      for (const grpc::Slice& part : slices) {
        answer.first.append(reinterpret_cast<const char*>(part.begin()),
                            part.size());
      }
    }
  }
  grpc::Status status;
  call->Finish(&status, nullptr);
  next();
  answer.status = FromGrpc(status);
  return answer;
}

}  // namespace deform
