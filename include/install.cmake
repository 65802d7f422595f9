# Installs the library for C, C++, Fortran and Python hosts, as any C library is installed:
#
#     cargo build --release
#     cmake -DPREFIX=/usr/local -P include/install.cmake
#
# PREFIX  where to (default /usr/local); DESTDIR in the environment is put before it
# FROM    where cargo has put the libraries (default target/release)
#
# Hosts then say `pkg-config --cflags --libs diffusph`, or in CMake
#
#     find_package(diffusph 0.1)
#     target_link_libraries(host diffusph::diffusph)   # diffusph::static, diffusph::fortran (compiled by the host)
cmake_minimum_required(VERSION 3.16)

get_filename_component(root "${CMAKE_CURRENT_LIST_DIR}/.." ABSOLUTE)
if(NOT DEFINED PREFIX)
    set(PREFIX /usr/local)
endif()
if(NOT DEFINED FROM)
    set(FROM "${root}/target/release")
endif()
get_filename_component(PREFIX "${PREFIX}" ABSOLUTE)
set(to "$ENV{DESTDIR}${PREFIX}")

foreach(part MAJOR MINOR PATCH)
    file(STRINGS "${root}/include/diffusph.h" line REGEX "^#define DIFFUSPH_VERSION_${part} ")
    string(REGEX MATCH "[0-9]+$" ${part} "${line}")
endforeach()
set(version "${MAJOR}.${MINOR}.${PATCH}")
file(STRINGS "${root}/include/diffusph.h" line REGEX "^#define DIFFUSPH_ABI ")
string(REGEX MATCH "[0-9]+$" ABI "${line}")
set(shared "libdiffusph.so.${version}")
# What the archive needs besides itself, as `rustc --print native-static-libs` says on Linux.
set(system_libraries "-lgcc_s -lutil -lrt -lpthread -lm -ldl -lc")

foreach(file libdiffusph.so libdiffusph.a)
    if(NOT EXISTS "${FROM}/${file}")
        message(FATAL_ERROR "${FROM}/${file} is missing; run `cargo build --release` first, or set -DFROM=")
    endif()
endforeach()

file(INSTALL "${root}/include/diffusph.h" "${root}/include/diffusph.f90" "${root}/include/diffusph.py" DESTINATION "${to}/include")
configure_file("${FROM}/libdiffusph.so" "${to}/lib/${shared}" COPYONLY)
file(CREATE_LINK "${shared}" "${to}/lib/libdiffusph.so.${ABI}" SYMBOLIC)
file(CREATE_LINK "libdiffusph.so.${ABI}" "${to}/lib/libdiffusph.so" SYMBOLIC)

# The archive as one object that has no names but ours and keeps nothing that they do not use: other Rust libraries have
# a Rust of their own. Without binutils it is installed as it is.
find_program(LD ld)
find_program(OBJCOPY objcopy)
find_program(READELF readelf)
find_program(AR ar)
file(MAKE_DIRECTORY "${to}/lib")
if(LD AND OBJCOPY AND READELF AND AR)
    file(STRINGS "${root}/include/diffusph.h" lines REGEX "^int32_t diffusph_[a-z_]+\\(")
    set(roots "")
    foreach(line IN LISTS lines)
        string(REGEX MATCH "diffusph_[a-z_]+" name "${line}")
        list(APPEND roots -u ${name})
    endforeach()
    # What may be missing when a host is linked; ld -r forgets that.
    execute_process(COMMAND "${READELF}" -sW "${FROM}/libdiffusph.a" OUTPUT_VARIABLE symbols ERROR_QUIET)
    string(REGEX MATCHALL "WEAK +DEFAULT +UND +[A-Za-z0-9_]+" lines "${symbols}")
    list(REMOVE_DUPLICATES lines)
    set(weak "")
    foreach(line IN LISTS lines)
        string(REGEX MATCH "[A-Za-z0-9_]+$" name "${line}")
        list(APPEND weak --weaken-symbol=${name})
    endforeach()
    set(object "${to}/lib/diffusph.o")
    file(REMOVE "${to}/lib/libdiffusph.a")
    foreach(command
            "${LD};-r;--gc-sections;--force-group-allocation;${roots};${FROM}/libdiffusph.a;-o;${object}"
            "${OBJCOPY};-w;--keep-global-symbol=diffusph_*;${weak};-R;.llvmbc;-R;.llvmcmd;${object}"
            "${AR};rcs;${to}/lib/libdiffusph.a;${object}")
        execute_process(COMMAND ${command} RESULT_VARIABLE failed ERROR_VARIABLE why)
        if(failed)
            message(FATAL_ERROR "${command}: ${why}")
        endif()
    endforeach()
    file(REMOVE "${object}")
else()
    file(INSTALL "${FROM}/libdiffusph.a" DESTINATION "${to}/lib")
endif()

file(WRITE "${to}/lib/pkgconfig/diffusph.pc" "prefix=\${pcfiledir}/../..
Name: diffusph
Description: Diffusion on SPH particles
Version: ${version}
Cflags: -I\${prefix}/include
Libs: -L\${prefix}/lib -ldiffusph
Libs.private: ${system_libraries}
")

# Before 1.0 a new minor version may break hosts.
file(WRITE "${to}/lib/cmake/diffusph/diffusph-config-version.cmake" "set(PACKAGE_VERSION ${version})
if(PACKAGE_FIND_VERSION VERSION_LESS_EQUAL PACKAGE_VERSION
        AND PACKAGE_FIND_VERSION_MAJOR EQUAL ${MAJOR}
        AND (PACKAGE_FIND_VERSION_COUNT EQUAL 1 OR PACKAGE_FIND_VERSION_MINOR EQUAL ${MINOR}))
    set(PACKAGE_VERSION_COMPATIBLE TRUE)
    if(PACKAGE_FIND_VERSION VERSION_EQUAL PACKAGE_VERSION)
        set(PACKAGE_VERSION_EXACT TRUE)
    endif()
endif()
")
file(WRITE "${to}/lib/cmake/diffusph/diffusph-config.cmake" "get_filename_component(_prefix \"\${CMAKE_CURRENT_LIST_DIR}/../../..\" ABSOLUTE)
if(NOT TARGET diffusph::diffusph)
    add_library(diffusph::diffusph SHARED IMPORTED)
    set_target_properties(diffusph::diffusph PROPERTIES
        IMPORTED_LOCATION \"\${_prefix}/lib/${shared}\"
        IMPORTED_SONAME libdiffusph.so.${ABI}
        INTERFACE_INCLUDE_DIRECTORIES \"\${_prefix}/include\")
    add_library(diffusph::static STATIC IMPORTED)
    set_target_properties(diffusph::static PROPERTIES
        IMPORTED_LOCATION \"\${_prefix}/lib/libdiffusph.a\"
        INTERFACE_LINK_LIBRARIES \"${system_libraries}\"
        INTERFACE_INCLUDE_DIRECTORIES \"\${_prefix}/include\")
    # Module files belong to one compiler: the host compiles the module, if it has enabled Fortran.
    get_property(_languages GLOBAL PROPERTY ENABLED_LANGUAGES)
    if(Fortran IN_LIST _languages)
        add_library(diffusph_fortran STATIC EXCLUDE_FROM_ALL \"\${_prefix}/include/diffusph.f90\")
        set_target_properties(diffusph_fortran PROPERTIES
            Fortran_MODULE_DIRECTORY \"\${CMAKE_CURRENT_BINARY_DIR}/diffusph_fortran\")
        target_include_directories(diffusph_fortran PUBLIC \"\${CMAKE_CURRENT_BINARY_DIR}/diffusph_fortran\")
        target_link_libraries(diffusph_fortran PUBLIC diffusph::diffusph)
        add_library(diffusph::fortran ALIAS diffusph_fortran)
    endif()
endif()
")
