#include "semblance/core/html_page.h"

#include <fmt/format.h>

#include <algorithm>

namespace semblance {
namespace {

constexpr const char* k_style = R"(
:root{--ink:#1c2329;--soft:#5c6770;--line:#dde2e6;--paper:#fff}
*{box-sizing:border-box}
body{margin:0;background:#f4f6f7;color:var(--ink);font:15px/1.5 system-ui,"Segoe UI",Roboto,"Helvetica Neue",Arial,"DejaVu Sans",sans-serif}
main{max-width:1100px;margin:0 auto;padding:32px 30px 40px;background:var(--paper)}
h1{font-size:26px;font-weight:650;margin:0;letter-spacing:-.01em;overflow-wrap:anywhere}
h2{font-size:17px;font-weight:650;margin:38px 0 8px;padding-bottom:5px;border-bottom:1px solid var(--line)}
p{max-width:72ch;margin:6px 0}
.sub,.note,figcaption{color:var(--soft)}
.note{font-size:13.5px}
.cards{display:grid;grid-template-columns:repeat(auto-fit,minmax(150px,1fr));gap:10px;margin:22px 0 14px}
.card{border:1px solid var(--line);border-radius:8px;padding:10px 14px}
.card b{display:block;font-size:23px;font-weight:620;line-height:1.3;font-variant-numeric:tabular-nums}
.card span{font-size:13px;color:var(--soft)}
.bad b{color:#c4232b}.warn b{color:#a86200}.good b{color:#22764a}
svg.chart{display:block;width:100%;height:auto;margin:3px 0;break-inside:avoid}
.pair{display:grid;grid-template-columns:1fr 1fr;column-gap:20px}
.name{font-size:13px;font-weight:600;fill:var(--ink)}.unit{font-weight:400;fill:var(--soft)}
.tick{font-size:10.5px;fill:var(--soft);font-variant-numeric:tabular-nums}
.grid{stroke:#e4e8eb;stroke-width:1}
.curve{fill:none;stroke-width:1.25;stroke-linejoin:round}
.band{fill-opacity:.2}
.cursor{stroke:#1c2329;stroke-width:1;stroke-opacity:.55}
.legend{display:flex;flex-wrap:wrap;gap:4px 20px;font-size:13px;color:var(--soft);margin:6px 0 2px}
.legend i{display:inline-block;width:22px;height:11px;margin-right:6px;vertical-align:-1px}
.sheet{display:grid;grid-template-columns:repeat(4,1fr);gap:12px}
figure{margin:0;break-inside:avoid}
figure img{display:block;width:100%;height:auto;border-radius:4px}
figcaption{font-size:12.5px;font-variant-numeric:tabular-nums;line-height:1.35;margin-top:3px}
table{border-collapse:collapse;font-size:13.5px;font-variant-numeric:tabular-nums}
th{text-align:left;font-weight:600;color:var(--soft)}
td,th{padding:3px 18px 3px 0;border-bottom:1px solid var(--line);vertical-align:top;overflow-wrap:anywhere}
td.n,th.n{text-align:right;white-space:nowrap}
.bar{display:block;height:10px;background:#0b5cad;border-radius:2px;min-width:1px}
summary{cursor:pointer;color:#0b5cad;margin:8px 0}
footer{margin-top:40px;color:var(--soft);font-size:13px}
#readout{position:fixed;right:14px;bottom:12px;background:#1c2329;color:#fff;font-size:13px;padding:3px 10px;border-radius:5px;visibility:hidden;font-variant-numeric:tabular-nums}
@media (max-width:760px){.pair{grid-template-columns:1fr}.sheet{grid-template-columns:1fr 1fr}main{padding:18px 14px}}
@media print{body{background:#fff;font-size:12px}main{padding:0;max-width:none}#readout{display:none}*{print-color-adjust:exact;-webkit-print-color-adjust:exact}}
)";

}  // namespace

std::string escape_html(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string html_head(const std::string& title) {
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"/>\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n"
      "<title>{}</title>\n<style>{}</style></head>\n",
      escape_html(title), k_style);
}

std::string html_card(const std::string& figure, const std::string& label, const char* kind) {
  return fmt::format("<div class=\"card {}\"><b>{}</b><span>{}</span></div>\n", kind,
                     escape_html(figure), escape_html(label));
}

std::string base64(const std::vector<std::uint8_t>& bytes) {
  static constexpr char alphabet[] =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t present = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t word = 0;
    for (std::size_t k = 0; k < 3; ++k) word = word << 8 | (k < present ? bytes[i + k] : 0u);
    for (std::size_t k = 0; k < 4; ++k)
      out += k <= present ? alphabet[word >> (18 - 6 * k) & 63] : '=';
  }
  return out;
}

}  // namespace semblance
