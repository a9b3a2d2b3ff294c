#pragma once
/// @file access.hpp
/// Who may talk to the server. Pure, but for the file of the token.
///
/// A page from elsewhere reaches 127.0.0.1 through a name that its owner points there (DNS rebinding), and WebSockets
/// know no same-origin rule. So the Host must be an address, not a name, and the Origin must be that same Host.
#include <string>
#include <string_view>

namespace view {

/// `localhost` or a numeric address (an IPv6 one in brackets), with or without a port: what no foreign name can be.
/// The port may be another one than the server's: behind `ssh -L` it is.
[[nodiscard]] bool allowed_host(std::string_view host);

/// `http://` and exactly `host`. Empty is allowed: programs send none, browsers always do.
[[nodiscard]] bool allowed_origin(std::string_view origin, std::string_view host);

/// Takes the same time wherever they differ.
[[nodiscard]] bool same_token(std::string_view a, std::string_view b) noexcept;

/// The key that the page has to present: 128 random bits in hexadecimal digits. It stays the same from start to start,
/// so that an open page finds its server again: it is kept in `rtbus/view_token`, readable by its owner only, in
/// $XDG_RUNTIME_DIR, $XDG_CACHE_HOME or ~/.cache. Where none of them can be written, it is made anew.
[[nodiscard]] std::string view_token();

}  // namespace view
