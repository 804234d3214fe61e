// What the pages that the program writes have in common: self-contained, readable without network.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace semblance {

/// Text as it may stand in HTML and SVG, between tags and in quoted attributes.
std::string escape_html(const std::string& text);

/// The page's beginning, with its style, up to the end of <head>. <body><main> should follow.
std::string html_head(const std::string& title);

/// A figure with its label, for a <div class="cards">. `kind`: "good", "warn", "bad" or none.
std::string html_card(const std::string& figure, const std::string& label, const char* kind = "");

/// Bytes as `data:` addresses have them (RFC 4648), for pictures inside a page.
std::string base64(const std::vector<std::uint8_t>& bytes);

}  // namespace semblance
