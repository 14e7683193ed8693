//! The loader, the instance, and the messages of the validation layer.

use super::{
    drivers::{examine_all, fix_of_none, why_none},
    inherited::check_address_space,
};
use crate::error::{Error, Result};
use ash::{ext, vk};
use std::{
    ffi::{CStr, c_void},
    sync::{Arc, Mutex, OnceLock},
};

/// The layer that checks every call.
pub(super) const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Ends the name of each module that takes derivatives in compute, so that a message about it can be
/// told from the same message about another.
pub(super) const WITH_DERIVATIVES: &str = "(with derivatives)";

/// A message of the validation layer that is not ours to fix.
struct Filtered {
    /// Parts of the message, together specific enough to name one cause.
    parts: &'static [&'static str],
    /// Why it is wrong.
    #[cfg_attr(not(test), allow(dead_code))]
    reason: &'static str,
}

/// The only filter there is: whatever is not listed here fails the test that caused it.
const FILTERED: &[Filtered] = &[
    Filtered {
        parts: &["VK_KHR_compute_shader_derivatives is not supported by this layer"],
        reason: "Debian 12 ships the layer of 1.3.239, which is older than the extension. The layer \
                 says so once for each device; what it then checks is not changed.",
    },
    Filtered {
        parts: &[
            "SPIR-V Extension (SPV_KHR_compute_shader_derivatives) was declared that is not supported",
        ],
        reason: "The same layer, once for each kernel with derivatives.",
    },
    Filtered {
        parts: &["operand ComputeDerivativeGroupLinearNV(5350) requires one of these extensions"],
        reason: "The same layer, which knows the capability by its older name. It looks no further \
                 into that module; the suite holds spirv-val against spliced modules itself.",
    },
    Filtered {
        parts: &[
            "After specialization was applied, VkShaderModule",
            WITH_DERIVATIVES,
            "does not contain valid spirv for stage VK_SHADER_STAGE_COMPUTE_BIT",
        ],
        reason: "The same layer says so, without a reason, of each such module that is specialized.",
    },
];

/// Warnings and errors that the validation layer reported, in order.
pub(super) type Messages = Arc<Mutex<Vec<String>>>;

/// The instance. If it is ours, it is destroyed on drop, after everything that was made from it.
pub(super) struct Instance {
    pub raw: ash::Instance,
    /// Whether it is the caller's.
    adopted: bool,
    /// Whether objects get names, for the messages of the validation layer and for captures.
    pub names: bool,
    /// Whether `VK_EXT_debug_utils` is on: labels and names cost nothing without a listener.
    pub debug_utils: bool,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    pub messages: Messages,
}

/// The loader, opened once and never closed: drivers leave threads and exit handlers behind that do
/// not survive being unloaded.
pub(super) fn loader() -> Result<&'static ash::Entry> {
    static ENTRY: OnceLock<std::result::Result<ash::Entry, String>> = OnceLock::new();
    // SAFETY: loading runs the loader's initialisers; it is the system's own Vulkan loader.
    ENTRY.get_or_init(|| unsafe { ash::Entry::load() }.map_err(|e| e.to_string())).as_ref().map_err(
        |reason| {
            Error::Device(format!(
                "no Vulkan loader: {reason}; install it and a driver \
                 (Debian, Ubuntu: apt install libvulkan1 mesa-vulkan-drivers)"
            ))
        },
    )
}

impl Instance {
    pub fn new(validation: bool) -> Result<Self> {
        check_address_space()?;
        let entry = loader()?;
        // SAFETY: a query without preconditions.
        let layers = unsafe { entry.enumerate_instance_layer_properties() }.unwrap_or_default();
        if validation && !layers.iter().any(|l| l.layer_name_as_c_str() == Ok(VALIDATION_LAYER)) {
            return Err(Error::Device(
                "validation was asked for, but the layer VK_LAYER_KHRONOS_validation is not \
                 installed (Debian, Ubuntu: apt install vulkan-validationlayers)"
                    .into(),
            ));
        }
        // SAFETY: a query without preconditions.
        let extensions =
            unsafe { entry.enumerate_instance_extension_properties(None) }.unwrap_or_default();
        let debug_utils = validation
            || extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(ext::debug_utils::NAME));

        let application = vk::ApplicationInfo::default()
            .application_name(c"tilewright")
            .engine_name(c"tilewright")
            .api_version(vk::API_VERSION_1_3);
        let layer_names = if validation { vec![VALIDATION_LAYER.as_ptr()] } else { vec![] };
        let mut extension_names =
            if debug_utils { vec![ext::debug_utils::NAME.as_ptr()] } else { vec![] };
        // Checking for hazards between commands is off unless asked for, and finds what no driver on
        // one machine shows. Newer layers take it as a setting, and do not look at what shaders access
        // unless another one says so.
        let offers = |name| validation && layer_offers(entry, name);
        let by_settings = offers(ext::layer_settings::NAME);
        let by_features = !by_settings && offers(ext::validation_features::NAME);
        if by_settings {
            extension_names.push(ext::layer_settings::NAME.as_ptr());
        }
        if by_features {
            extension_names.push(ext::validation_features::NAME.as_ptr());
        }
        let hazards = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features =
            vk::ValidationFeaturesEXT::default().enabled_validation_features(&hazards);
        let on = vk::TRUE.to_ne_bytes();
        let wanted = [c"validate_sync", c"syncval_shader_accesses_heuristic"].map(|name| {
            let setting = vk::LayerSettingEXT::default().ty(vk::LayerSettingTypeEXT::BOOL32);
            let setting = setting.layer_name(VALIDATION_LAYER).setting_name(name).values(&on);
            vk::LayerSettingEXT { value_count: 1, ..setting }
        });
        let mut settings = vk::LayerSettingsCreateInfoEXT::default().settings(&wanted);
        let messages = Messages::default();
        // Chained to the instance as well, so that messages about its creation are seen.
        let mut messenger_info = messenger_info(&messages);
        let mut info = vk::InstanceCreateInfo::default()
            .application_info(&application)
            .enabled_layer_names(&layer_names)
            .enabled_extension_names(&extension_names);
        if validation {
            info = info.push_next(&mut messenger_info);
        }
        if by_settings {
            info = info.push_next(&mut settings);
        }
        if by_features {
            info = info.push_next(&mut features);
        }
        // SAFETY: all pointers in `info` outlive the call; `messages` outlives the instance.
        let raw = unsafe { entry.create_instance(&info, None) }.map_err(|e| {
            // If a driver file is broken, loaders report that memory is short.
            let variable = |name: &str| std::env::var_os(name);
            let no_driver = e == vk::Result::ERROR_INCOMPATIBLE_DRIVER
                || examine_all(variable).iter().any(|file| file.fault.is_some());
            Error::Device(match no_driver {
                true => format!(
                    "{}; {} (`tilewright doctor` says more)",
                    why_none(variable),
                    fix_of_none(variable)
                ),
                false => format!("the Vulkan instance could not be created: {e}"),
            })
        })?;
        let messenger = if validation {
            let loader = ext::debug_utils::Instance::new(entry, &raw);
            // SAFETY: the instance was created with VK_EXT_debug_utils.
            unsafe { loader.create_debug_utils_messenger(&messenger_info, None) }
                .ok()
                .map(|messenger| (loader, messenger))
        } else {
            None
        };
        Ok(Self { raw, adopted: false, names: validation, debug_utils, messenger, messages })
    }

    /// An instance of the caller, which has `VK_EXT_debug_utils` on if `debug_utils` says so.
    pub fn adopted(raw: ash::Instance, debug_utils: bool) -> Self {
        let messages = Messages::default();
        Self { raw, adopted: true, names: debug_utils, debug_utils, messenger: None, messages }
    }
}

/// Whether the validation layer brings this extension.
fn layer_offers(entry: &ash::Entry, name: &CStr) -> bool {
    // SAFETY: a query of a layer that is installed.
    let all = unsafe { entry.enumerate_instance_extension_properties(Some(VALIDATION_LAYER)) };
    all.unwrap_or_default().iter().any(|e| e.extension_name_as_c_str() == Ok(name))
}

impl Drop for Instance {
    fn drop(&mut self) {
        // SAFETY: all children are destroyed: whoever made them held this instance.
        unsafe {
            if let Some((loader, messenger)) = self.messenger.take() {
                loader.destroy_debug_utils_messenger(messenger, None);
            }
            if !self.adopted {
                self.raw.destroy_instance(None);
            }
        }
    }
}

/// The messenger that appends warnings and errors to `messages`, which it points to.
fn messenger_info(messages: &Messages) -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
    type Severity = vk::DebugUtilsMessageSeverityFlagsEXT;
    type Type = vk::DebugUtilsMessageTypeFlagsEXT;
    vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(Severity::WARNING | Severity::ERROR)
        .message_type(Type::GENERAL | Type::VALIDATION | Type::PERFORMANCE)
        .pfn_user_callback(Some(on_message))
        .user_data(Arc::as_ptr(messages) as *mut c_void)
}

unsafe extern "system" fn on_message(
    severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    kind: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    messages: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layer passes valid data; `messages` is the pointer of `messenger_info`, whose
    // `Arc` the instance holds.
    let (id, text, messages) = unsafe {
        let data = &*data;
        let id = data.message_id_name_as_c_str().map(CStr::to_string_lossy).unwrap_or_default();
        let text = data.message_as_c_str().map(CStr::to_string_lossy).unwrap_or_default();
        (id, text, &*(messages as *const Mutex<Vec<String>>))
    };
    // The loader's own remarks are about files and names, not about what we do; what matters of them
    // comes back as an error code.
    if kind == vk::DebugUtilsMessageTypeFlagsEXT::GENERAL {
        log::debug!("{text}");
        return vk::FALSE;
    }
    if !FILTERED.iter().any(|f| f.parts.iter().all(|part| text.contains(part))) {
        let kind = if severity.contains(vk::DebugUtilsMessageSeverityFlagsEXT::ERROR) {
            "error"
        } else {
            "warning"
        };
        log::warn!("Vulkan {kind}: {text}");
        if let Ok(mut messages) = messages.lock() {
            messages.push(format!("{kind}: {id}: {text}"));
        }
    }
    vk::FALSE
}

#[cfg(test)]
mod tests {
    use super::FILTERED;

    #[test]
    fn every_filtered_message_is_specific_and_has_a_reason() {
        for f in FILTERED {
            let length: usize = f.parts.iter().map(|part| part.len()).sum();
            assert!(length > 20 && f.reason.ends_with('.'), "{:?}", f.parts);
        }
    }
}
