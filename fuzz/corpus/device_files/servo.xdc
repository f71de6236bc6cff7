<?xml version="1.0" encoding="utf-8"?>
<!-- A small description of a device that does not exist, for tests. -->
<ISO15745ProfileContainer xmlns="http://www.ethernet-powerlink.org" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:schemaLocation="http://www.ethernet-powerlink.org Powerlink_Main.xsd">
  <ISO15745Profile>
    <ProfileHeader>
      <ProfileIdentification>Powerlink_Device_Profile</ProfileIdentification>
      <ProfileRevision>1</ProfileRevision>
      <ProfileName>servo.xdc device profile</ProfileName>
      <ProfileSource/>
      <ProfileClassID>Device</ProfileClassID>
      <ISO15745Reference>
        <ISO15745Part>4</ISO15745Part>
        <ISO15745Edition>1</ISO15745Edition>
        <ProfileTechnology>Powerlink</ProfileTechnology>
      </ISO15745Reference>
    </ProfileHeader>
    <ProfileBody xsi:type="ProfileBody_Device_Powerlink" fileName="servo.xdc" fileCreator="isocnc" fileCreationDate="2026-01-01" fileVersion="01.00" supportedLanguages="en">
      <DeviceIdentity>
        <vendorName>Example Drives</vendorName>
        <vendorID>0x0000FACE</vendorID>
        <productName>ED-402</productName>
        <productID>ED-402-R1</productID>
        <version versionType="HW">1.00</version>
      </DeviceIdentity>
      <DeviceFunction/>
      <ApplicationProcess>
        <parameterList>
          <parameter uniqueID="UID_NOTCH" access="readWrite">
            <label lang="en">Notch filter</label>
            <UINT/>
            <actualValue value="820"/>
            <defaultValue value="0"/>
            <allowedValues>
              <range>
                <minValue value="0"/>
                <maxValue value="4000"/>
              </range>
            </allowedValues>
          </parameter>
        </parameterList>
      </ApplicationProcess>
    </ProfileBody>
  </ISO15745Profile>
  <ISO15745Profile>
    <ProfileHeader>
      <ProfileIdentification>Powerlink_Communication_Profile</ProfileIdentification>
      <ProfileRevision>1</ProfileRevision>
      <ProfileName>servo.xdc communication profile</ProfileName>
      <ProfileSource/>
      <ProfileClassID>CommunicationNetwork</ProfileClassID>
      <ISO15745Reference>
        <ISO15745Part>4</ISO15745Part>
        <ISO15745Edition>1</ISO15745Edition>
        <ProfileTechnology>Powerlink</ProfileTechnology>
      </ISO15745Reference>
    </ProfileHeader>
    <ProfileBody xsi:type="ProfileBody_CommunicationNetwork_Powerlink" fileName="servo.xdc" fileCreator="isocnc" fileCreationDate="2026-01-01" fileVersion="01.00" supportedLanguages="en">
      <ApplicationLayers>
        <DataTypeList>
          <defType dataType="0005"><Unsigned8/></defType>
          <defType dataType="0007"><Unsigned32/></defType>
        </DataTypeList>
        <ObjectList>
          <Object index="1000" name="NMT_DeviceType_U32" objectType="7" dataType="0007" accessType="const" PDOmapping="no" defaultValue="0x00020192"/>
          <Object index="1001" name="ERR_ErrorRegister_U8" objectType="7" dataType="0005" accessType="ro" PDOmapping="optional" defaultValue="0"/>
          <Object index="1006" name="NMT_CycleLen_U32" objectType="7" dataType="0007" accessType="rw" PDOmapping="no" defaultValue="1000" lowLimit="200" highLimit="0xFFFFFFFF"/>
          <Object index="1008" name="NMT_ManufactDevName_VS" objectType="7" dataType="0009" accessType="const" PDOmapping="no" defaultValue="Test device"/>
          <Object index="1018" name="NMT_IdentityObject_REC" objectType="9">
            <SubObject subIndex="00" name="NumberOfEntries" objectType="7" dataType="0005" accessType="const" defaultValue="4"/>
            <SubObject subIndex="01" name="VendorId_U32" objectType="7" dataType="0007" accessType="const" defaultValue="0x0000FACE"/>
            <SubObject subIndex="02" name="ProductCode_U32" objectType="7" dataType="0007" accessType="const" defaultValue="0x00000402"/>
            <SubObject subIndex="03" name="RevisionNo_U32" objectType="7" dataType="0007" accessType="const" defaultValue="0x00010003"/>
            <SubObject subIndex="04" name="SerialNo_U32" objectType="7" dataType="0007" accessType="const"/>
          </Object>
          <Object index="1F82" name="NMT_FeatureFlags_U32" objectType="7" dataType="0007" accessType="const" PDOmapping="no" defaultValue="0x00010265"/>
          <Object index="1C0D" name="DLL_CNLossPReq_REC" objectType="9">
            <SubObject subIndex="00" name="NumberOfEntries" objectType="7" dataType="0005" accessType="const" defaultValue="3"/>
            <SubObject subIndex="01" name="CumulativeCnt_U32" objectType="7" dataType="0007" accessType="rw" defaultValue="0"/>
            <SubObject subIndex="02" name="ThresholdCnt_U32" objectType="7" dataType="0007" accessType="ro" defaultValue="0"/>
            <SubObject subIndex="03" name="Threshold_U32" objectType="7" dataType="0007" accessType="rw" defaultValue="15"/>
          </Object>
          <Object index="1C14" name="DLL_CNLossOfSocTolerance_U32" objectType="7" dataType="0007" accessType="rw" PDOmapping="no" defaultValue="100000" actualValue="5000000"/>
          <Object index="1F98" name="NMT_CycleTiming_REC" objectType="9">
            <SubObject subIndex="00" name="NumberOfEntries" objectType="7" dataType="0005" accessType="const" defaultValue="9"/>
            <SubObject subIndex="01" name="IsochrTxMaxPayload_U16" objectType="7" dataType="0006" accessType="const" defaultValue="64"/>
            <SubObject subIndex="02" name="IsochrRxMaxPayload_U16" objectType="7" dataType="0006" accessType="const" defaultValue="64"/>
            <SubObject subIndex="03" name="PResMaxLatency_U32" objectType="7" dataType="0007" accessType="const" defaultValue="30000"/>
            <SubObject subIndex="04" name="PReqActPayloadLimit_U16" objectType="7" dataType="0006" accessType="rw" defaultValue="36"/>
            <SubObject subIndex="05" name="PResActPayloadLimit_U16" objectType="7" dataType="0006" accessType="rw" defaultValue="36"/>
            <SubObject subIndex="06" name="ASndMaxLatency_U32" objectType="7" dataType="0007" accessType="const" defaultValue="50000"/>
            <SubObject subIndex="07" name="MultiplCycleCnt_U8" objectType="7" dataType="0005" accessType="rw" defaultValue="0"/>
            <SubObject subIndex="08" name="AsyncMTU_U16" objectType="7" dataType="0006" accessType="rw" defaultValue="300" lowLimit="300" highLimit="1500"/>
            <SubObject subIndex="09" name="Prescaler_U16" objectType="7" dataType="0006" accessType="rw" defaultValue="2" highLimit="1000"/>
          </Object>
          <Object index="1400" name="PDO_RxCommParam_0h_REC" objectType="9">
            <SubObject subIndex="00" name="NumberOfEntries" objectType="7" dataType="0005" accessType="const" defaultValue="2"/>
            <SubObject subIndex="01" name="NodeID_U8" objectType="7" dataType="0005" accessType="rw" defaultValue="0"/>
            <SubObject subIndex="02" name="MappingVersion_U8" objectType="7" dataType="0005" accessType="rw" defaultValue="0"/>
          </Object>
          <Object index="1600" name="PDO_RxMappParam_0h_AU64" objectType="9">
            <SubObject subIndex="00" name="NumberOfEntries" objectType="7" dataType="0005" accessType="rw" defaultValue="2"/>
            <SubObject subIndex="01" name="ObjectMapping" objectType="7" dataType="001B" accessType="rw" defaultValue="0x0010000000006040"/>
            <SubObject subIndex="02" name="ObjectMapping" objectType="7" dataType="001B" accessType="rw" defaultValue="0x002000100000607A"/>
          </Object>
          <Object index="1401" name="PDO_RxCommParam_1h_REC" objectType="9">
            <SubObject subIndex="00" name="NumberOfEntries" objectType="7" dataType="0005" accessType="const" defaultValue="2"/>
            <SubObject subIndex="01" name="NodeID_U8" objectType="7" dataType="0005" accessType="rw" defaultValue="0" actualValue="3"/>
            <SubObject subIndex="02" name="MappingVersion_U8" objectType="7" dataType="0005" accessType="rw" defaultValue="0"/>
          </Object>
          <Object index="1601" name="PDO_RxMappParam_1h_AU64" objectType="9">
            <SubObject subIndex="00" name="NumberOfEntries" objectType="7" dataType="0005" accessType="rw" defaultValue="0" actualValue="1"/>
            <SubObject subIndex="01" name="ObjectMapping" objectType="7" dataType="001B" accessType="rw" defaultValue="0x0000000000000000" actualValue="0x0010000800022010"/>
            <SubObject subIndex="02" name="ObjectMapping" objectType="7" dataType="001B" accessType="rw" defaultValue="0x0000000000000000"/>
          </Object>
          <Object index="1800" name="PDO_TxCommParam_0h_REC" objectType="9">
            <SubObject subIndex="00" name="NumberOfEntries" objectType="7" dataType="0005" accessType="const" defaultValue="2"/>
            <SubObject subIndex="01" name="NodeID_U8" objectType="7" dataType="0005" accessType="rw" defaultValue="0"/>
            <SubObject subIndex="02" name="MappingVersion_U8" objectType="7" dataType="0005" accessType="rw" defaultValue="0"/>
          </Object>
          <Object index="1A00" name="PDO_TxMappParam_0h_AU64" objectType="9">
            <SubObject subIndex="00" name="NumberOfEntries" objectType="7" dataType="0005" accessType="rw" defaultValue="2"/>
            <SubObject subIndex="01" name="ObjectMapping" objectType="7" dataType="001B" accessType="rw" defaultValue="0x0010000000006041"/>
            <SubObject subIndex="02" name="ObjectMapping" objectType="7" dataType="001B" accessType="rw" defaultValue="0x0020001000006064"/>
          </Object>
          <Object index="2010" name="Tuning" objectType="9">
            <SubObject subIndex="00" name="NumberOfEntries" objectType="7" dataType="0005" accessType="const" defaultValue="4"/>
            <SubObject subIndex="01" name="Gain" objectType="7" dataType="0006" accessType="rw" defaultValue="100" actualValue="250" lowLimit="1" highLimit="1000"/>
            <SubObject subIndex="02" name="FeedForward" objectType="7" dataType="0003" accessType="rw" defaultValue="0" actualValue="0" PDOmapping="RPDO"/>
            <SubObject subIndex="03" name="Friction" objectType="7" dataType="0008" accessType="rw" defaultValue="0.5" actualValue="0.75"/>
            <SubObject subIndex="04" name="Offset" objectType="7" dataType="0003" accessType="rw" defaultValue="0" actualValue="0xFFFE"/>
          </Object>
          <Object index="2020" name="OwnAddress" objectType="7" dataType="0005" accessType="rw" defaultValue="0" actualValue="$NODEID+0x40"/>
          <Object index="2030" name="SerialText" objectType="7" dataType="0009" accessType="ro" defaultValue="A1" actualValue="B2"/>
          <Object index="2040" name="Notch" objectType="7" uniqueIDRef="UID_NOTCH" PDOmapping="no"/>
          <Object index="603F" name="Error code" objectType="7" dataType="0006" accessType="ro" PDOmapping="TPDO"/>
          <Object index="6040" name="Controlword" objectType="7" dataType="0006" accessType="rw" PDOmapping="RPDO"/>
          <Object index="6041" name="Statusword" objectType="7" dataType="0006" accessType="ro" PDOmapping="TPDO"/>
          <Object index="605A" name="Quick stop option code" objectType="7" dataType="0003" accessType="rw" PDOmapping="no" defaultValue="2" lowLimit="-32768" highLimit="32767"/>
          <Object index="6060" name="Modes of operation" objectType="7" dataType="0002" accessType="rw" PDOmapping="RPDO"/>
          <Object index="6061" name="Modes of operation display" objectType="7" dataType="0002" accessType="ro" PDOmapping="TPDO"/>
          <Object index="6064" name="Position actual value" objectType="7" dataType="0004" accessType="ro" PDOmapping="TPDO"/>
          <Object index="6065" name="Following error window" objectType="7" dataType="0007" accessType="rw" PDOmapping="no"/>
          <Object index="606C" name="Velocity actual value" objectType="7" dataType="0004" accessType="ro" PDOmapping="optional"/>
          <Object index="607A" name="Target position" objectType="7" dataType="0004" accessType="rw" PDOmapping="RPDO"/>
          <Object index="607C" name="Home offset" objectType="7" dataType="0004" accessType="rw" PDOmapping="no"/>
          <Object index="6085" name="Quick stop deceleration" objectType="7" dataType="0007" accessType="rw" PDOmapping="no"/>
          <Object index="6098" name="Homing method" objectType="7" dataType="0002" accessType="rw" PDOmapping="no"/>
          <Object index="6099" name="Homing speeds" objectType="8" dataType="0007">
            <SubObject subIndex="00" name="NumberOfEntries" objectType="7" dataType="0005" accessType="const" defaultValue="2"/>
            <SubObject subIndex="01" name="Search" objectType="7" dataType="0007" accessType="rw" defaultValue="0"/>
            <SubObject subIndex="02" name="Latch" objectType="7" dataType="0007" accessType="rw" defaultValue="0"/>
          </Object>
          <Object index="609A" name="Homing acceleration" objectType="7" dataType="0007" accessType="rw" PDOmapping="no"/>
          <Object index="60C2" name="Interpolation time period" objectType="9">
            <SubObject subIndex="00" name="NumberOfEntries" objectType="7" dataType="0005" accessType="const" defaultValue="2"/>
            <SubObject subIndex="01" name="Digits" objectType="7" dataType="0005" accessType="rw" defaultValue="1"/>
            <SubObject subIndex="02" name="Exponent" objectType="7" dataType="0002" accessType="rw" defaultValue="-3"/>
          </Object>
          <Object index="60F4" name="Following error actual value" objectType="7" dataType="0004" accessType="ro" PDOmapping="TPDO"/>
          <Object index="60FD" name="Digital inputs" objectType="7" dataType="0007" accessType="ro" PDOmapping="TPDO"/>
          <Object index="60FE" name="Digital outputs" objectType="9">
            <SubObject subIndex="00" name="NumberOfEntries" objectType="7" dataType="0005" accessType="const" defaultValue="2"/>
            <SubObject subIndex="01" name="Physical outputs" objectType="7" dataType="0007" accessType="rw" PDOmapping="default"/>
            <SubObject subIndex="02" name="Bit mask" objectType="7" dataType="0007" accessType="rw" PDOmapping="no"/>
          </Object>
        </ObjectList>
      </ApplicationLayers>
      <TransportLayers/>
      <NetworkManagement>
        <GeneralFeatures DLLFeatureMN="false" NMTBootTimeNotActive="3000000" NMTCycleTimeMin="200" NMTCycleTimeMax="10000" NMTErrorEntries="2" PDORPDOChannels="2" PDORPDOChannelObjects="8" PDOTPDOChannelObjects="8" SDOServer="true"/>
        <CNFeatures DLLCNFeatureMultiplex="true" DLLCNPResChaining="false" NMTCNSoC2PReq="1000"/>
        <deviceCommissioning nodeID="7"/>
        <Diagnostic/>
      </NetworkManagement>
    </ProfileBody>
  </ISO15745Profile>
</ISO15745ProfileContainer>
