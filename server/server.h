// deformd as an object: the one place where the rooms are joined.
#pragma once

#include <chrono>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "server/options.h"

namespace deform::server {

class Server {
 public:
  // Serves from the moment this returns.
  static absl::StatusOr<std::unique_ptr<Server>> Start(const Options& options);
  ~Server();

  // As clients dial it: "127.0.0.1:43121".
  const std::string& address() const;

  // Answers what is pending, then ends; see GrpcServer::Drain(). Call it once.
  bool Drain(std::chrono::milliseconds patience);

 private:
  struct Parts;
  explicit Server(std::unique_ptr<Parts> parts);

  std::unique_ptr<Parts> parts_;
};

}  // namespace deform::server
