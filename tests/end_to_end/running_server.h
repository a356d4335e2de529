// A server in this process and a client of it.
#pragma once

#include <spdlog/spdlog.h>

#include <memory>
#include <string>
#include <vector>

#include "client/cpp/client.h"
#include "server/options.h"
#include "server/server.h"
#include "tests/support/shapes.h"

namespace deform {

// Options for tests: a free port, and nothing kept.
inline server::Options TestOptions() {
  server::Options options;
  options.listen = "127.0.0.1:0";
  options.in_memory = true;
  return options;
}

// A ball of 162 points in a cube with 8 vertices and 12 faces.
inline Mesh Ball() { return MeshOf(Icosphere(0.5, 2)); }
inline Cage Cube() {
  return CageOf(Cuboid(Vec3::Constant(-1), Vec3::Constant(1)));
}

class RunningServer {
 public:
  explicit RunningServer(const server::Options& options = TestOptions())
      : server_(server::Server::Start(options).value()), client_(Connect()) {
    spdlog::set_level(spdlog::level::warn);
  }

  server::Server& server() { return *server_; }
  const std::string& address() const { return server_->address(); }
  Client& client() { return client_; }
  Client Connect(const std::string& tenant = "") {
    return Client::Connect(address(), {.tenant = tenant}).value();
  }

  // Registers the ball and binds it to the cube.
  BindingInfo BindBall() { return BindBall(client_); }
  static BindingInfo BindBall(Client& client) {
    const ModelInfo model = client.RegisterModel(Ball(), "ball").value();
    return client.CreateBinding({.model_id = model.model_id, .rig = Cube()})
        .value();
  }
  // The id of a session of that binding.
  std::string BallSession() {
    return client_.CreateSession(BindBall().binding_id).value().session_id;
  }

 private:
  std::unique_ptr<server::Server> server_;
  Client client_;
};

}  // namespace deform
