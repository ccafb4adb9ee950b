// The functions of Beast that are no templates, compiled once (BOOST_BEAST_SEPARATE_COMPILATION in CMakeLists.txt).
#include <boost/beast/src.hpp>
