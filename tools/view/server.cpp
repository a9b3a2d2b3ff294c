// The only file that knows libwebsockets.
#include "tools/view/server.hpp"

#include <arpa/inet.h>
#include <libwebsockets.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <set>
#include <utility>

#include "rtbus/clock.hpp"
#include "tools/view/access.hpp"
#include "tools/view/page_client.hpp"
#include "tools/view/page_files.hpp"

namespace view {

namespace {

static_assert(kMessageRoom >= LWS_PRE);

/// The name that the page asks for: another version of the protocol is another name.
constexpr const char* kSubprotocol = "rtbus-view-1";
constexpr std::uint64_t kFrame_us = 1'000'000 / ServerLimits::kFrames_hz;
constexpr std::uint64_t kIdle_us = 100'000;  ///< Between two looks for a signal.

std::string header(lws* connection, lws_token_indexes token) {
  std::array<char, 512> text{};
  const int length = lws_hdr_copy(connection, text.data(), static_cast<int>(text.size()), token);
  return length > 0 ? std::string(text.data(), static_cast<std::size_t>(length)) : "";
}

bool is_ipv6(const std::string& address) { return address.find(':') != std::string::npos; }

/// Why nobody can listen there; "": one can. The library says so only in its log.
std::string listening_trouble(const ServerOptions& options) {
  const std::string place =
      (is_ipv6(options.address) ? "[" + options.address + "]" : options.address) + ":" + std::to_string(options.port);
  sockaddr_storage storage{};
  socklen_t size = 0;
  if (auto* const four = reinterpret_cast<sockaddr_in*>(&storage);
      ::inet_pton(AF_INET, options.address.c_str(), &four->sin_addr) == 1) {
    four->sin_family = AF_INET;
    four->sin_port = htons(static_cast<std::uint16_t>(options.port));
    size = sizeof *four;
  } else if (auto* const six = reinterpret_cast<sockaddr_in6*>(&storage);
             ::inet_pton(AF_INET6, options.address.c_str(), &six->sin6_addr) == 1) {
    six->sin6_family = AF_INET6;
    six->sin6_port = htons(static_cast<std::uint16_t>(options.port));
    size = sizeof *six;
  } else {
    return "'" + options.address + "' is not a numeric address of this machine (--listen 127.0.0.1, 0.0.0.0, ::1)";
  }
  const int fd = ::socket(storage.ss_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const int one = 1;
  if (fd >= 0) ::setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
  const bool works =
      fd >= 0 && ::bind(fd, reinterpret_cast<const sockaddr*>(&storage), size) == 0 && ::listen(fd, 1) == 0;
  const int error = errno;
  if (fd >= 0) ::close(fd);
  if (works) return "";
  if (error == EADDRINUSE) return place + " is in use; another `rtbus view`? Choose --port N, or --port 0 for any";
  return "cannot listen on " + place + ": " + std::strerror(error);
}

}  // namespace

struct Server::Core {
  ServerOptions options;
  MakeSource make_source;
  std::unique_ptr<SessionOrders> orders;
  std::shared_ptr<FrameSource> source;
  std::set<std::pair<lws*, PageClient*>> pages;
  lws_context* context = nullptr;
  int port = 0;
  /// First member: lws hands back its address.
  struct Timer {
    lws_sorted_usec_list_t list{};
    Core* core = nullptr;
  } timer;
  std::array<lws_protocols, 3> protocols{};

  void tick();
  int refuse(lws* connection, unsigned status, const char* why);
  int serve_file(lws* connection, const char* path);
  int write_file(lws* connection, void* user);
  int write_page(lws* connection, PageClient& page);
  int receive(lws* connection, PageClient& page, const char* bytes, std::size_t size);
  bool admits(lws* connection) const;

  static Core& of(lws* connection) { return *static_cast<Core*>(lws_context_user(lws_get_context(connection))); }
  static int on_http(lws* connection, lws_callback_reasons reason, void* user, void* in, std::size_t size) noexcept;
  static int on_page(lws* connection, lws_callback_reasons reason, void* user, void* in, std::size_t size) noexcept;
  static void on_timer(lws_sorted_usec_list_t* list) { reinterpret_cast<Timer*>(list)->core->tick(); }
};

void Server::Core::tick() {
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  bool looks = false;
  for (const auto& [connection, page] : pages) {
    page->check_patience(now_ns);
    looks = looks || page->looks(now_ns);
  }
  if (looks && !source) source = make_source();
  if (!looks) source.reset();
  if (source) {
    source->follow();
    orders->follow(source->session(), now_ns);
  }
  for (const auto& [connection, page] : pages) {
    if (page->wants(source.get())) lws_callback_on_writable(connection);
  }
  const std::uint64_t wait_us = pages.empty() ? kIdle_us : kFrame_us;
  lws_sul_schedule(context, 0, &timer.list, &on_timer, static_cast<lws_usec_t>(wait_us));
}

bool Server::Core::admits(lws* connection) const {
  const std::string host = header(connection, WSI_TOKEN_HOST);
  return allowed_host(host) && allowed_origin(header(connection, WSI_TOKEN_ORIGIN), host) &&
         (lws_hdr_total_length(connection, WSI_TOKEN_ORIGIN) == 0) == header(connection, WSI_TOKEN_ORIGIN).empty();
}

int Server::Core::refuse(lws* connection, unsigned status, const char* why) {
  lws_return_http_status(connection, status, why);
  return -1;
}

int Server::Core::serve_file(lws* connection, const char* path) {
  if (!admits(connection)) return refuse(connection, HTTP_STATUS_FORBIDDEN, "not from here");
  if (lws_hdr_total_length(connection, WSI_TOKEN_GET_URI) == 0) {
    return refuse(connection, HTTP_STATUS_METHOD_NOT_ALLOWED, "GET only");
  }
  const std::string_view wanted = std::string_view(path) == "/" ? "/index.html" : path;
  for (const PageFile& file : page_files()) {
    if (file.path != wanted) continue;
    *static_cast<const PageFile**>(lws_wsi_user(connection)) = &file;
    std::array<unsigned char, LWS_PRE + 2048> buffer{};
    unsigned char* const begin = buffer.data() + LWS_PRE;
    unsigned char* at = begin;
    unsigned char* const end = buffer.data() + buffer.size() - 1;
    const auto add = [&](const char* name, const std::string& value) {
      return lws_add_http_header_by_name(connection, reinterpret_cast<const unsigned char*>(name),
                                         reinterpret_cast<const unsigned char*>(value.c_str()),
                                         static_cast<int>(value.size()), &at, end) == 0;
    };
    const std::string host = header(connection, WSI_TOKEN_HOST);
    const bool added = lws_add_http_common_headers(connection, HTTP_STATUS_OK, std::string(file.type).c_str(),
                                                   file.bytes.size(), &at, end) == 0 &&
                       add("content-security-policy:",
                           "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: "
                           "blob:; connect-src 'self' ws://" +
                               host +
                               "; base-uri 'none'; form-action "
                               "'none'; frame-ancestors 'none'") &&
                       add("x-content-type-options:", "nosniff") &&
                       add("cross-origin-resource-policy:", "same-origin") && add("referrer-policy:", "no-referrer") &&
                       add("cache-control:", "no-store");
    if (!added || lws_finalize_write_http_header(connection, begin, &at, end) != 0) return 1;
    lws_callback_on_writable(connection);
    return 0;
  }
  return refuse(connection, HTTP_STATUS_NOT_FOUND, "not a file of this page");
}

int Server::Core::write_file(lws* connection, void* user) {
  const PageFile* const file = *static_cast<const PageFile**>(user);
  if (file == nullptr) return 0;
  std::vector<unsigned char> bytes(LWS_PRE);
  bytes.insert(bytes.end(), file->bytes.begin(), file->bytes.end());
  if (lws_write(connection, bytes.data() + LWS_PRE, file->bytes.size(), LWS_WRITE_HTTP_FINAL) < 0) return 1;
  *static_cast<const PageFile**>(user) = nullptr;
  return lws_http_transaction_completed(connection) != 0 ? -1 : 0;
}

int Server::Core::on_http(lws* connection, lws_callback_reasons reason, void* user, void* in,
                          std::size_t size) noexcept {
  switch (reason) {
    case LWS_CALLBACK_HTTP:
      return of(connection).serve_file(connection, static_cast<const char*>(in));
    case LWS_CALLBACK_HTTP_WRITEABLE:
      return of(connection).write_file(connection, user);
    case LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION:  // a WebSocket that does not ask for our protocol
      return -1;
    default:
      return lws_callback_http_dummy(connection, reason, user, in, size);
  }
}

int Server::Core::write_page(lws* connection, PageClient& page) {
  if (page.refusal() != Refusal::kNone) {
    std::string why = to_string(page.refusal());
    lws_close_reason(connection, static_cast<lws_close_status>(page.refusal()),
                     reinterpret_cast<unsigned char*>(why.data()), why.size());
    return -1;
  }
  std::optional<PageClient::Outgoing> out = page.next(source.get(), rtbus::monotonic_ns());
  if (!out) return 0;
  const std::size_t size = out->bytes.size() - kMessageRoom;
  const int written =
      lws_write(connection, out->bytes.data() + kMessageRoom, size, out->binary ? LWS_WRITE_BINARY : LWS_WRITE_TEXT);
  if (written < 0) return -1;
  if (page.wants(source.get())) lws_callback_on_writable(connection);
  return 0;
}

int Server::Core::receive(lws* connection, PageClient& page, const char* bytes, std::size_t size) {
  const bool whole = lws_is_first_fragment(connection) != 0 && lws_is_final_fragment(connection) != 0 &&
                     lws_remaining_packet_payload(connection) == 0;
  if (!whole) {
    page.refuse(Refusal::kTooLong);
  } else {
    page.receive(std::string_view(bytes, size), source.get(), rtbus::monotonic_ns());
  }
  // Turned away here and now, so that the rest of a long message is not read.
  if (page.refusal() != Refusal::kNone) return write_page(connection, page);
  if (page.wants(source.get())) lws_callback_on_writable(connection);
  return 0;
}

int Server::Core::on_page(lws* connection, lws_callback_reasons reason, void* user, void* in,
                          std::size_t size) noexcept {
  auto** const page = static_cast<PageClient**>(user);
  switch (reason) {
    case LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION:
      return of(connection).admits(connection) ? 0 : -1;
    case LWS_CALLBACK_ESTABLISHED: {
      Core& core = of(connection);
      *page = new PageClient(core.options.token, *core.orders, rtbus::monotonic_ns());
      if (core.pages.size() >= ServerLimits::kPages) (*page)->refuse(Refusal::kTooManyPages);
      core.pages.insert({connection, *page});
      if (core.pages.size() == 1) lws_sul_schedule(core.context, 0, &core.timer.list, &on_timer, 1);
      return 0;
    }
    case LWS_CALLBACK_CLOSED:
      of(connection).pages.erase({connection, *page});
      delete std::exchange(*page, nullptr);
      return 0;
    case LWS_CALLBACK_RECEIVE:
      return of(connection).receive(connection, **page, static_cast<const char*>(in), size);
    case LWS_CALLBACK_SERVER_WRITEABLE:
      return of(connection).write_page(connection, **page);
    default:
      return 0;
  }
}

Server::Server() : core_(std::make_unique<Core>()) {}

Server::~Server() {
  if (core_->context != nullptr) lws_context_destroy(core_->context);
}

rtbus::Result<std::unique_ptr<Server>, std::string> Server::open(const ServerOptions& options, OrderOptions orders,
                                                                 MakeSource make_source) {
  if (std::string trouble = listening_trouble(options); !trouble.empty()) return rtbus::Failure{std::move(trouble)};
  lws_set_log_level(0, nullptr);
  std::unique_ptr<Server> server(new Server());
  Core& core = *server->core_;
  core.options = options;
  core.orders = std::make_unique<SessionOrders>(std::move(orders));
  core.make_source = std::move(make_source);
  core.timer.core = &core;
  core.protocols[0] = {"http", &Core::on_http, sizeof(PageFile*), 0, 0, nullptr, 0};
  core.protocols[1] = {kSubprotocol, &Core::on_page, sizeof(PageClient*), ServerLimits::kMessageBytes, 0, nullptr, 0};

  // Peers that have vanished without a word are noticed by a ping; a browser answers it also for a hidden tab.
  static constexpr lws_retry_bo_t kPings{nullptr, 0, 0, 20, 40, 0};
  lws_context_creation_info info{};
  info.port = options.port;
  info.iface = options.address.c_str();
  info.protocols = core.protocols.data();
  info.user = &core;
  info.server_string = "rtbus";
  info.options = LWS_SERVER_OPTION_FAIL_UPON_UNABLE_TO_BIND;
  if (!is_ipv6(options.address)) info.options |= LWS_SERVER_OPTION_DISABLE_IPV6;
  info.timeout_secs = static_cast<unsigned>(ServerLimits::kPatience_s);
  info.keepalive_timeout = static_cast<int>(ServerLimits::kPatience_s);
  info.fd_limit_per_thread = ServerLimits::kConnections;
  info.retry_and_idle_policy = &kPings;
  info.gid = static_cast<gid_t>(-1);
  info.uid = static_cast<uid_t>(-1);
  core.context = lws_create_context(&info);
  if (core.context == nullptr) return rtbus::Failure{"cannot listen on " + options.address};
  core.port = lws_get_vhost_listen_port(lws_get_vhost_by_name(core.context, "default"));
  return server;
}

std::string Server::url() const {
  std::string host = core_->options.address;
  if (is_ipv6(host)) host = "[" + host + "]";
  return "http://" + host + ":" + std::to_string(core_->port) + "/#k=" + core_->options.token;
}

void Server::serve(const std::function<bool()>& ends) {
  core_->tick();
  while (!ends() && lws_service(core_->context, 0) >= 0) {
  }
}

}  // namespace view
