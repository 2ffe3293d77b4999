// Part of the precompiled headers, so no file includes it. libfmt has this function, but its headers do not say so:
// every file that logs would compile fmt's writers of numbers anew, a second each.
#pragma once

#include <fmt/format.h>

#if FMT_VERSION / 10000 == 9  // Debian 12; whether other versions' libraries have it was not looked up
extern template void fmt::detail::vformat_to<char>(fmt::detail::buffer<char>&, fmt::string_view, fmt::format_args,
                                                   fmt::detail::locale_ref);
#endif
