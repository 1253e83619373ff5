// Lists the Vulkan devices that a program started from here would find, one a line: kind, interlock, Vulkan version, name.
// Needs no Vulkan headers: set-up runs it before anything else is there. Exit status 1: no loader or no device.
#include <dlfcn.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef void *Handle;
typedef void (*Function)(void);
enum { SUCCESS = 0, APPLICATION_INFO = 0, INSTANCE_CREATE_INFO = 1, CPU = 4 };

typedef struct { uint32_t type; const void *next; const char *app; uint32_t app_version; const char *engine; uint32_t engine_version, api; } ApplicationInfo;
typedef struct { uint32_t type; const void *next; uint32_t flags; const ApplicationInfo *app; uint32_t layers; const char *const *layer; uint32_t extensions; const char *const *extension; } InstanceInfo;
typedef struct { uint32_t api, driver, vendor, device, kind; char name[256], rest[4096]; } Properties;
typedef struct { char name[256]; uint32_t version; } Extension;

int main(void) {
    void *loader = dlopen("libvulkan.so.1", RTLD_NOW);
    if (!loader) return 1;
    Function (*get)(Handle, const char *) = (Function(*)(Handle, const char *))dlsym(loader, "vkGetInstanceProcAddr");
    if (!get) return 1;
    ApplicationInfo app = {APPLICATION_INFO, 0, "welkin-probe", 0, 0, 0, 1u << 22 | 3u << 12};
    InstanceInfo info = {.type = INSTANCE_CREATE_INFO, .app = &app};
    Handle instance;
    if (((int32_t(*)(InstanceInfo *, void *, Handle *))get(0, "vkCreateInstance"))(&info, 0, &instance) != SUCCESS) return 1;

    Handle devices[16];
    uint32_t count = 16;
    ((int32_t(*)(Handle, uint32_t *, Handle *))get(instance, "vkEnumeratePhysicalDevices"))(instance, &count, devices);
    void (*properties_of)(Handle, Properties *) = (void (*)(Handle, Properties *))get(instance, "vkGetPhysicalDeviceProperties");
    int32_t (*extensions_of)(Handle, const char *, uint32_t *, Extension *) =
        (int32_t(*)(Handle, const char *, uint32_t *, Extension *))get(instance, "vkEnumerateDeviceExtensionProperties");
    for (uint32_t i = 0; i < count; i++) {
        Properties properties;
        properties_of(devices[i], &properties);
        uint32_t extensions = 0, interlock = 0;
        extensions_of(devices[i], 0, &extensions, 0);
        Extension *extension = calloc(extensions + 1, sizeof *extension);
        if (!extension) return 1;
        extensions_of(devices[i], 0, &extensions, extension);
        for (uint32_t e = 0; e < extensions; e++) interlock |= !strcmp(extension[e].name, "VK_EXT_fragment_shader_interlock");
        free(extension);
        printf("%s %s %u.%u %s\n", properties.kind == CPU ? "cpu" : "gpu", interlock ? "interlock" : "no-interlock",
               properties.api >> 22 & 127, properties.api >> 12 & 1023, properties.name);
    }
    return count == 0;
}
