#include "clients/live_view/page_files.h"

#include "page_stamp.h"

// The bundler's output, put in by the assembler as it is.
#define HUETRACK_EMBED(symbol, file)                                                       \
  asm(".section .rodata\n.balign 16\n.globl " #symbol "\n.globl " #symbol "_end\n" #symbol \
      ":\n.incbin \"" HUETRACK_PAGE_FOLDER "/" file "\"\n" #symbol "_end:\n.byte 0\n.previous\n");
HUETRACK_EMBED(huetrack_page_index_html, "index.html")
HUETRACK_EMBED(huetrack_page_css, "page.css")
HUETRACK_EMBED(huetrack_page_js, "page.js")
HUETRACK_EMBED(huetrack_page_help, "help.html")

extern "C" {
extern const char huetrack_page_index_html[], huetrack_page_index_html_end[];
extern const char huetrack_page_css[], huetrack_page_css_end[];
extern const char huetrack_page_js[], huetrack_page_js_end[];
extern const char huetrack_page_help[], huetrack_page_help_end[];
}

namespace huetrack::live_view {

// The bundler's hash: the same as the files that were put in above.
static_assert(sizeof(HUETRACK_PAGE_STAMP) > 1);

std::optional<PageFile> page_file(std::string_view path) {
  if (path == "/" || path == "/index.html")
    return PageFile{{huetrack_page_index_html, huetrack_page_index_html_end}, "text/html; charset=utf-8"};
  if (path == "/page.css") return PageFile{{huetrack_page_css, huetrack_page_css_end}, "text/css; charset=utf-8"};
  if (path == "/page.js") return PageFile{{huetrack_page_js, huetrack_page_js_end}, "text/javascript; charset=utf-8"};
  if (path == "/help.html") return PageFile{{huetrack_page_help, huetrack_page_help_end}, "text/html; charset=utf-8"};
  return std::nullopt;
}

}  // namespace huetrack::live_view
