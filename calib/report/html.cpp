#include "calib/report/html.h"

namespace huetrack::report {
namespace {

constexpr std::string_view style = R"(
:root { --ink:#1b2430; --soft:#5b6775; --line:#dde2e8; --good:#1a7f4b; --doubt:#a86400; --bad:#b3261e; --blue:#2563a8; }
* { box-sizing:border-box; }
body { font:15px/1.45 system-ui,sans-serif; color:var(--ink); margin:0 auto; padding:24px; max-width:1120px; background:#fff; }
h1 { font-size:22px; margin:0 0 4px; } h2 { font-size:18px; margin:34px 0 8px; } h3 { font-size:15px; margin:18px 0 6px; }
p { margin:6px 0; max-width:85ch; } .soft { color:var(--soft); }
.verdict { border-left:8px solid; padding:12px 16px; margin:14px 0; background:#f6f8fa; font-size:17px; }
.verdict.usable { border-color:var(--good); } .verdict.doubtful { border-color:var(--doubt); }
.verdict.failed { border-color:var(--bad); }
.usable b, td.usable { color:var(--good); } .doubtful b, td.doubtful { color:var(--doubt); }
.failed b, td.failed { color:var(--bad); }
table { border-collapse:collapse; font-variant-numeric:tabular-nums; margin:6px 0; }
th { text-align:left; font-weight:600; color:var(--soft); }
th,td { padding:3px 14px 3px 0; border-bottom:1px solid var(--line); vertical-align:top; }
td.n, th.n { text-align:right; }
.row { display:flex; flex-wrap:wrap; gap:20px; align-items:flex-start; } figure { margin:0; }
figcaption { color:var(--soft); font-size:13px; max-width:44ch; }
.drawn svg { max-width:100%; height:auto; } .drawn figcaption { max-width:85ch; margin:2px 0 14px; }
svg text { font:11px system-ui,sans-serif; fill:var(--ink); } svg { display:block; }
ul.todo { padding-left:20px; margin:8px 0; } ul.todo li { margin:8px 0; } details summary { cursor:pointer; color:var(--blue); }
)";

}  // namespace

std::string html_head(std::string_view title) {
  std::string out =
      "<!doctype html>\n<html lang=en><head><meta charset=utf-8><meta name=viewport "
      "content='width=device-width'><title>" +
      escaped(title) + "</title><style>";
  out += style;
  return out + "</style></head><body>\n";
}

}  // namespace huetrack::report
