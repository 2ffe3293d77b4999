// clang's name of this function is not that which libfmt has, as GCC compiled it: format_in_libfmt.h finds it here.
#include <fmt/format.h>

#ifdef __clang__
template void fmt::detail::vformat_to<char>(fmt::detail::buffer<char>&, fmt::string_view, fmt::format_args,
                                            fmt::detail::locale_ref);
#endif
