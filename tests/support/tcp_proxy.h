// A wire that can be cut.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <thread>
#include <vector>

#include "core/base/mutex.h"

namespace deform {

// Passes bytes between whoever connects to it and `target` ("127.0.0.1:PORT").
// One thread per connection, so for a few of them. Thread-safe.
class TcpProxy {
 public:
  explicit TcpProxy(const std::string& target);
  ~TcpProxy();

  // Where to connect to.
  const std::string& address() const { return address_; }

  // Resets all connections at once; bytes that are under way are lost.
  void Cut();
  // Cuts each connection once so many more bytes have come from the client, or
  // from the server, in all connections together; the bytes before them are
  // passed on. 0: never.
  void CutAfterUp(int64_t bytes) { cut_up_ = bytes; }
  void CutAfterDown(int64_t bytes) { cut_down_ = bytes; }
  // Where those are passed to who connect from now on.
  void SetTarget(const std::string& target);
  // While it is closed, whoever connects is turned away.
  void SetOpen(bool open) { open_ = open; }

  // Connections that were cut.
  int64_t cuts() const { return cuts_; }

 private:
  struct Pair {
    int client = -1;
    int server = -1;
    bool done = false;
  };

  void Accept();
  void Pass(size_t index, int client, int server);
  // False if the pair is to be cut.
  bool Copy(int from, int to, std::atomic<int64_t>& budget);

  std::atomic<int> target_port_;
  int listener_ = -1;
  std::string address_;
  std::atomic<bool> open_{true};
  std::atomic<bool> stopping_{false};
  std::atomic<int64_t> cut_up_{0};
  std::atomic<int64_t> cut_down_{0};
  std::atomic<int64_t> cuts_{0};
  Mutex mutex_;
  std::vector<Pair> pairs_ ABSL_GUARDED_BY(mutex_);
  std::vector<std::thread> passers_ ABSL_GUARDED_BY(mutex_);
  std::thread acceptor_;
};

}  // namespace deform
