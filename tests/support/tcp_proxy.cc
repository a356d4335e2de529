#include "tests/support/tcp_proxy.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>

namespace deform {
namespace {

sockaddr_in Loopback(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

// Closing then resets the connection instead of ending it in order.
void ResetOnClose(int socket) {
  const linger now{.l_onoff = 1, .l_linger = 0};
  setsockopt(socket, SOL_SOCKET, SO_LINGER, &now, sizeof(now));
}

void NoDelay(int socket) {
  const int on = 1;
  setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
}

int PortOf(const std::string& target) {
  return std::atoi(target.substr(target.rfind(':') + 1).c_str());
}

bool SendAll(int socket, const char* data, ssize_t size) {
  while (size > 0) {
    const ssize_t sent =
        send(socket, data, static_cast<size_t>(size), MSG_NOSIGNAL);
    if (sent <= 0) return false;
    data += sent;
    size -= sent;
  }
  return true;
}

}  // namespace

TcpProxy::TcpProxy(const std::string& target)
    : target_port_(PortOf(target)),
      listener_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  sockaddr_in address = Loopback(0);
  socklen_t size = sizeof(address);
  bind(listener_, reinterpret_cast<sockaddr*>(&address), size);
  listen(listener_, 64);
  getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size);
  address_ = "127.0.0.1:" + std::to_string(ntohs(address.sin_port));
  acceptor_ = std::thread([this] { Accept(); });
}

TcpProxy::~TcpProxy() {
  stopping_ = true;
  shutdown(listener_, SHUT_RDWR);
  acceptor_.join();
  Cut();
  std::vector<std::thread> passers;
  {
    MutexLock lock(mutex_);
    passers.swap(passers_);
  }
  for (std::thread& passer : passers) passer.join();
  close(listener_);
}

void TcpProxy::SetTarget(const std::string& target) {
  target_port_ = PortOf(target);
}

void TcpProxy::Accept() {
  while (!stopping_) {
    const int client = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
    if (client < 0) continue;
    const int server = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const sockaddr_in target = Loopback(target_port_);
    if (!open_ || connect(server, reinterpret_cast<const sockaddr*>(&target),
                          sizeof(target)) != 0) {
      ResetOnClose(client);
      close(client);
      close(server);
      continue;
    }
    NoDelay(client);
    NoDelay(server);
    MutexLock lock(mutex_);
    const size_t index = pairs_.size();
    pairs_.push_back({.client = client, .server = server});
    passers_.emplace_back([=, this] { Pass(index, client, server); });
  }
}

void TcpProxy::Cut() {
  MutexLock lock(mutex_);
  for (const Pair& pair : pairs_) {
    if (pair.done) continue;
    // Wakes the thread, which closes both.
    shutdown(pair.client, SHUT_RDWR);
    shutdown(pair.server, SHUT_RDWR);
  }
}

bool TcpProxy::Copy(int from, int to, std::atomic<int64_t>& budget) {
  char buffer[16384];
  const int64_t limit = budget;
  const size_t most =
      limit > 0 ? static_cast<size_t>(std::min<int64_t>(limit, sizeof(buffer)))
                : sizeof(buffer);
  const ssize_t got = recv(from, buffer, most, 0);
  if (got <= 0 || !SendAll(to, buffer, got)) return false;
  if (limit == 0) return true;
  // Another connection may have used it up, or a new one be set.
  int64_t expected = limit;
  budget.compare_exchange_strong(expected, std::max<int64_t>(limit - got, 0));
  return limit > got;
}

void TcpProxy::Pass(size_t index, int client, int server) {
  pollfd ends[2] = {{.fd = client, .events = POLLIN, .revents = 0},
                    {.fd = server, .events = POLLIN, .revents = 0}};
  bool open = true;
  while (open && !stopping_) {
    if (poll(ends, 2, -1) < 0) continue;
    if (ends[0].revents != 0) open = Copy(client, server, cut_up_);
    if (open && ends[1].revents != 0) open = Copy(server, client, cut_down_);
  }
  MutexLock lock(mutex_);
  pairs_[index].done = true;
  ++cuts_;
  ResetOnClose(client);
  ResetOnClose(server);
  close(client);
  close(server);
}

}  // namespace deform
